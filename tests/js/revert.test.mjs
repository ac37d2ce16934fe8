import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { originalOf } from '../../static/state/revert.js';

const entries = [
	{ kind: 'import', body: null },
	{ kind: 'edit', body: { inverse: { edit: 'set_lines', view: '7.png', lines: { 'Middle line': [[1, 2], [3, 4]] } } } },
	{ kind: 'edit', body: { inverse: { edit: 'set_lines', view: '7.png', lines: { 'Middle line': [[9, 9]], 'Circle left': null } } } },
	{ kind: 'edit', body: { inverse: { edit: 'set_balls', view: '7.png', balls: [] } } },
];
const point = { kind: 'point', view: '7.png', marking: 'Middle line', index: 0 };

describe('originalOf', () => {
	it('is what the first edit found', () => {
		assert.deepEqual(originalOf(point, entries).lines, { 'Middle line': [{ x: 1, y: 2 }, { x: 3, y: 4 }] });
	});

	it('takes away what was not there', () => {
		assert.deepEqual(originalOf({ ...point, marking: 'Circle left' }, entries).lines, { 'Circle left': null });
		assert.deepEqual(originalOf({ kind: 'ball', view: '7.png' }, entries), { kind: 'ball', view: '7.png', ball: null });
	});

	it('knows nothing of what nobody edited', () => {
		assert.equal(originalOf({ ...point, view: '7_1.png' }, entries), null);
		assert.equal(originalOf({ ...point, marking: 'Side line top' }, entries), null);
	});

	it('cannot bring several balls back at once', () => {
		const two = [{ kind: 'edit', body: { inverse: { edit: 'set_balls', view: '7.png', balls: [{}, {}] } } }];
		assert.equal(originalOf({ kind: 'ball', view: '7.png' }, two), 'several');
	});
});
