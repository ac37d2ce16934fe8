import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { addPoint, markingAt, placeFor } from '../../static/state/line_edits.js';

const line = [{ x: 0, y: 0 }, { x: 10, y: 0 }, { x: 20, y: 0 }];
const view = { key: '7.png', lines: { 'Middle line': line } };

describe('placeFor', () => {
	it('goes between the two points that it lies between', () => {
		assert.equal(placeFor(line, { x: 14, y: 1 }), 2);
	});

	it('goes on at the end that is nearer', () => {
		assert.equal(placeFor(line, { x: 27, y: 0 }), 3);
		assert.equal(placeFor(line, { x: -6, y: 1 }), 0);
	});

	it('follows the first point of a new line', () => {
		assert.equal(placeFor([], { x: 1, y: 1 }), 0);
		assert.equal(placeFor([{ x: 5, y: 5 }], { x: 1, y: 1 }), 1);
	});
});

describe('addPoint', () => {
	it('makes a marking that is not there yet', () => {
		const { edit, index } = addPoint(view, 'Side line top', { x: 3, y: 4 });
		assert.deepEqual(edit.lines, { 'Side line top': [{ x: 3, y: 4 }] });
		assert.equal(index, 0);
	});

	it('says where the new point stands and changes no other', () => {
		const { edit, index } = addPoint(view, 'Middle line', { x: 4, y: 0.5 });
		assert.equal(index, 1);
		assert.deepEqual(edit.lines['Middle line'], [line[0], { x: 4, y: 0.5 }, line[1], line[2]]);
		assert.equal(view.lines['Middle line'].length, 3);
	});
});

describe('markingAt', () => {
	it('finds the line within reach', () => {
		assert.equal(markingAt(view, { x: 12, y: 2 }, 3), 'Middle line');
	});

	it('finds none beyond it, nor beyond its ends', () => {
		assert.equal(markingAt(view, { x: 12, y: 4 }, 3), null);
		assert.equal(markingAt(view, { x: 25, y: 0 }, 3), null);
	});
});
