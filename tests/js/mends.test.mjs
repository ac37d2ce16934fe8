import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { groupDocument } from '../../static/state/group.js';
import { isHeld, mend, mends } from '../../static/state/mends.js';
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

const offered = () => mend.value?.fix.action;

describe('what the card offers', () => {
	it('waits until it is known whether lines are proposed, and never changes after that', () => {
		show({}, 'a');
		assert.deepEqual([isHeld.value, mend.value], [true, null]);
		assert.ok(mends.value.length > 0);
		openProposals.value = new Map([['A', proposal]]);
		settledState.value = stateOf(groupDocument.value);
		assert.equal(offered(), 'accept_proposal');
		// The same group after an edit: what is proposed stands there until the answer comes.
		show({}, 'b');
		assert.equal(offered(), 'accept_proposal');
		openProposals.value = new Map();
		assert.equal(mend.value, null);
		settledState.value = stateOf(groupDocument.value);
		assert.equal(offered(), 'draw_ball');
	});

	it('waits for nothing where every view has a camera', () => {
		show(LINES, 'c');
		assert.deepEqual([isHeld.value, offered()], [false, 'draw_ball']);
	});
});
