import assert from 'node:assert/strict';
import test from 'node:test';

import { placeOf } from '../../static/state/tab_order.js';

const VIEW = /** @type {any} */ ({
	key: 'a', lines: { 'Middle line': [{ x: 10, y: 0 }, { x: 10, y: 50 }] }, balls: [{ box: [100, 40, 20, 10] }],
});

test('every object of a view has a place in its picture, and what is gone has none', () => {
	const point = (/** @type {number} */ index) => placeOf({ kind: 'point', view: 'a', marking: 'Middle line', index }, VIEW);
	assert.deepEqual([point(1), point(2)], [{ x: 10, y: 50 }, null]);
	assert.deepEqual(placeOf({ kind: 'ball', view: 'a' }, VIEW), { x: 110, y: 45 });
	assert.equal(placeOf({ kind: 'ball', view: 'a' }, { ...VIEW, balls: [] }), null);
	const marks = [{ id: 7, box: /** @type {[number, number, number, number]} */ ([0, 0, 20, 10]) }];
	assert.deepEqual(placeOf({ kind: 'prediction', view: 'a', prediction: 7 }, VIEW, marks), { x: 10, y: 5 });
	assert.equal(placeOf({ kind: 'prediction', view: 'a', prediction: 8 }, VIEW, marks), null);
});
