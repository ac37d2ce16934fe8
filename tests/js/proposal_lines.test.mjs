import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { applyEdit, describe as describe_, editOf, requestOf, swapSides } from '../../static/state/edits.js';
import { asProposed, isBare } from '../../static/state/proposal_lines.js';
import { begin, PROPOSED, proposedLines, stage, stepBack } from '../../static/state/staging.js';

const SIDE = [{ x: 0, y: 0 }, { x: 0, y: 90 }];
const MIDDLE = [{ x: 10, y: 0 }, { x: 10, y: 50 }];
const LINES = { 'Side line left': SIDE, 'Middle line': MIDDLE };
const view = { id: 31, key: '7.png', letter: 'A', station: { id: 3, shared: false, has_given: false }, image: '/i', lines: {}, balls: [] };
const group = { id: 12, etag: '"g"', views: [view] };
const accept = { kind: 'lines', view: '7.png', lines: LINES, proposed: Object.keys(LINES) };

describe('isBare', () => {
	it('asks for a picture, and for neither lines nor a given camera', () => {
		assert.ok(isBare(view));
		assert.ok(!isBare({ ...view, image: null }));
		assert.ok(!isBare({ ...view, lines: LINES }));
		assert.ok(!isBare({ ...view, station: { ...view.station, has_given: true } }));
	});
});

describe('asProposed', () => {
	it('names those whose points nobody moved, whichever side they are on', () => {
		assert.deepEqual(asProposed({ 'Side line right': SIDE, 'Middle line': MIDDLE }, LINES), ['Side line right', 'Middle line']);
		assert.deepEqual(asProposed({ 'Middle line': [MIDDLE[0], { x: 11, y: 50 }], 'Side line left': null, 'Side line top': SIDE }, LINES), []);
	});

	it('knows what was proposed for as long as that step is in force', () => {
		const staged = stage(stage(begin({}), LINES, 'Lines proposed', PROPOSED), { 'Middle line': MIDDLE }, 'deleted');
		assert.equal(proposedLines(staged), LINES);
		assert.deepEqual(proposedLines(stepBack(stepBack(staged))), {});
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
