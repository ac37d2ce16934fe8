import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { applyEdit, describe as describe_, editOf, requestOf, swapSides } from '../../static/state/edits.js';
import { areNew, asProposed, besideDrawn, scoreWords, waitingViews, waitsForLines } from '../../static/state/proposal_lines.js';
import { begin, PROPOSED, proposedLines, stage, stepBack } from '../../static/state/staging.js';

const SIDE = [{ x: 0, y: 0 }, { x: 0, y: 90 }];
const MIDDLE = [{ x: 10, y: 0 }, { x: 10, y: 50 }];
const LINES = { 'Side line left': SIDE, 'Middle line': MIDDLE };
const view = { id: 31, key: '7.png', letter: 'A', station: { id: 3, shared: false, has_given: false }, image: '/i', lines: {}, balls: [] };
const group = { id: 12, etag: '"g"', views: [view] };
const accept = { kind: 'lines', view: '7.png', lines: LINES, proposed: Object.keys(LINES) };

describe('waitsForLines', () => {
	/** @param {object} calibration */
	const solved = (calibration) => ({ views: [{ view: '7.png', calibration: { camera: {}, unobservable: [], ...calibration } }] });
	const lined = { ...view, lines: LINES };

	it('asks for a picture, and for neither lines nor a given camera', () => {
		assert.ok(waitsForLines(view, null));
		assert.ok(!waitsForLines({ ...view, image: null }, null));
		assert.ok(!waitsForLines({ ...view, station: { ...view.station, has_given: true } }, null));
	});

	it('asks for lines that determine no camera, once that is known', () => {
		assert.ok(!waitsForLines(lined, null));
		assert.ok(!waitsForLines(lined, solved({})));
		assert.ok(waitsForLines(lined, solved({ camera: null })));
		assert.ok(waitsForLines(lined, solved({ unobservable: ['position'] })));
		assert.deepEqual(waitingViews({ ...group, views: [lined], solution: solved({ camera: null }) }), [lined]);
	});

	it('is over once one of the proposed markings is there', () => {
		assert.ok(areNew({ 'Side line left': SIDE }, { 'Middle line': MIDDLE }));
		assert.ok(!areNew(LINES, { 'Middle line': MIDDLE }));
	});
});

describe('besideDrawn', () => {
	it('adds what nobody drew and leaves what is drawn', () => {
		const moved = [{ x: 3, y: 0 }];
		assert.deepEqual(besideDrawn({ 'Middle line': moved }, LINES), { all: { 'Side line left': SIDE, 'Middle line': moved }, added: ['Side line left'] });
	});
});

describe('scoreWords', () => {
	it('says what was measured', () => {
		const item = { supported: 0.92, explained: 0.8, error_px: 0.214 };
		assert.equal(scoreWords(item), '92\u00a0% of its markings have paint, 80\u00a0% of the paint has a marking, 0.21 px between them');
		assert.equal(scoreWords({ ...item, explained: null, error_px: null }), '92\u00a0% of its markings have paint');
	});
});

describe('asProposed', () => {
	it('names those whose points nobody moved, whichever side they are on', () => {
		assert.deepEqual(asProposed({ 'Side line right': SIDE, 'Middle line': MIDDLE }, LINES), ['Side line right', 'Middle line']);
		assert.deepEqual(asProposed({ 'Middle line': [MIDDLE[0], { x: 11, y: 50 }], 'Side line left': null, 'Side line top': SIDE }, LINES), []);
	});

	it('knows what was proposed for as long as that step is in force', () => {
		const staged = stage(stage(begin({}), LINES, 'Lines proposed', PROPOSED), { 'Middle line': MIDDLE }, 'deleted');
		assert.deepEqual(proposedLines(staged), LINES);
		assert.deepEqual(proposedLines(stepBack(stepBack(staged))), {});
	});

	it('does not name what was drawn before, saved or staged', () => {
		const drawn = stage(begin({ 'Side line top': SIDE }), { 'Side line top': SIDE, 'Side line left': SIDE }, 'drawn');
		const staged = stage(drawn, { 'Side line top': SIDE, ...LINES }, 'Lines proposed', PROPOSED);
		assert.deepEqual(proposedLines(staged), { 'Middle line': MIDDLE });
	});
});

describe('an edit that accepts what is proposed', () => {
	it('is sent with the names, and shows them at once', () => {
		assert.deepEqual(requestOf(group, accept).body, { lines: LINES, proposed: Object.keys(LINES) });
		assert.deepEqual(applyEdit(group, accept).views[0].proposed, ['Middle line', 'Side line left']);
		assert.equal(describe_(group, accept), 'Lines of A accepted as proposed');
	});

	it('loses the source of a marking that is moved, and keeps it where sides are swapped', () => {
		const after = applyEdit(group, accept);
		const moved = { kind: 'lines', view: '7.png', lines: { 'Middle line': [MIDDLE[0]] } };
		assert.deepEqual(applyEdit(after, moved).views[0].proposed, ['Side line left']);
		assert.deepEqual(applyEdit(after, swapSides(after.views[0])).views[0].proposed, ['Middle line', 'Side line right']);
		assert.deepEqual(requestOf(group, moved).body, { lines: moved.lines });
	});

	it('is read from the history', () => {
		const said = { edit: 'set_lines', view: '7.png', lines: { 'Middle line': [[10, 0]] }, source: { 'Middle line': 'proposed' } };
		assert.deepEqual(editOf(said).proposed, ['Middle line']);
	});
});
