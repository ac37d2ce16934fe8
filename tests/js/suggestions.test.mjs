import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { groupDocument } from '../../static/state/group.js';
import { remedies } from '../../static/state/insight.js';
import { isHeld, suggestion, suggestions } from '../../static/state/suggestions.js';
import { openProposals, settledState, stateOf } from '../../static/state/proposal_lines.js';

const view = (key, lines) => ({ key, letter: key, included: true, image: '/i', station: { has_given: false }, lines, balls: [] });
const calibrated = (key) => ({ view: key, failed: null, calibration: { camera: {}, unobservable: [] }, expected: null });
const LINES = { 'Middle line': [{ x: 1, y: 2 }, { x: 3, y: 4 }] };
const solution = { ball: null, passes: false, first_failing: { gate: 'ball' }, findings: [], views: [calibrated('B')] };
const proposal = { outcome: 'proposed', lines: LINES, sentence: '', supported: null, explained: null, error_px: null };

/** Show a group whose view A has these lines and B waits for its ball. @param {object} lines @param {string} etag */
function show(lines, etag) {
	const views = [view('A', lines), view('B', LINES)];
	const own = { ...solution, views: Object.keys(lines).length ? [calibrated('A'), calibrated('B')] : solution.views };
	groupDocument.value = { id: 7, etag, views, solution: own };
}

const offered = () => suggestion.value?.label;

describe('what the card offers', () => {
	it('waits until it is known whether lines are proposed, and never changes after that', () => {
		show({}, 'a');
		assert.deepEqual([isHeld.value, suggestion.value], [true, null]);
		assert.ok(suggestions.value.length > 0);
		openProposals.value = new Map([['A', proposal]]);
		settledState.value = stateOf(groupDocument.value);
		assert.equal(offered(), 'Accept the lines');
		// The same group after an edit: what is proposed stands there until the answer comes.
		show({}, 'b');
		assert.equal(offered(), 'Accept the lines');
		openProposals.value = new Map();
		assert.equal(suggestion.value, null);
		settledState.value = stateOf(groupDocument.value);
		// Nobody has looked at the picture of A, which has no lines.
		assert.deepEqual(suggestions.value.map(({ label }) => label), ['Propose lines', 'Draw it']);
		openProposals.value = new Map([['A', { ...proposal, outcome: 'nothing', lines: {} }]]);
		assert.equal(offered(), 'Draw it');
		openProposals.value = new Map();
	});

	it('waits for nothing where every view has a camera', () => {
		show(LINES, 'c');
		assert.deepEqual([isHeld.value, offered()], [false, 'Draw it']);
	});
});

describe('a kind of fix that nobody here has heard of', () => {
	const fix = { action: 'unheard_of', view: 'A', marking: 'Middle line', to: null, index: 1 };
	const edit = { edit: 'set_lines', view: 'A', lines: { 'Middle line': [[5, 6]] } };
	const guide = { label: 'Go there', caption: 'here', draws: null, looks: [7, 8], reads: false };
	const finding = { kind: 'new', sentence: 'Look.', view: 'A', marking: null, fix, offers: [{ label: 'Do it', caption: 'this', edit }], guide: null };

	/** What is offered for some findings and remedies. @param {object[]} findings @param {object[]} items */
	const offers = (findings, items) => {
		show(LINES, 'd');
		groupDocument.value = { ...groupDocument.value, solution: { ...groupDocument.value.solution, first_failing: null, passes: true, findings } };
		remedies.value = { key: 'remedies 7 d', id: 7, items };
		return suggestions.value;
	};

	it('is carried out and pointed at as the server says', () => {
		const [found] = offers([finding], []);
		assert.deepEqual([found.label, found.caption, found.marking, found.index], ['Do it', 'this', 'Middle line', 1]);
		assert.deepEqual(found.edit, { kind: 'lines', view: 'A', lines: { 'Middle line': [{ x: 5, y: 6 }] } });
		const [led] = offers([{ ...finding, fix: null, offers: [], guide }], []);
		assert.deepEqual([led.label, led.caption, led.guide, led.edit], ['Go there', 'here', guide, undefined]);
	});

	it('is listed once where finding and remedy propose the same', () => {
		const remedy = { edit: fix, offers: finding.offers, guide: null, sentence: 'so', passes: true };
		assert.deepEqual(offers([finding], [remedy]).map(({ title, passes }) => [title, passes]), [['New', true]]);
		const other = { ...remedy, edit: { ...fix, index: 0 } };
		assert.deepEqual(offers([finding], [other]).map(({ title, passes }) => [title, passes]), [['New', false], [null, true]]);
	});
});
