/** How far the axis of a chart reaches. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { withIntervals } from '../../static/views/chart_options.js';

/** @param {(number | null)[]} low @param {(number | null)[]} high */
const curve = (low, high) => ({ label: '', colour: /** @type {const} */ ('chart-a'), values: [], low, high });

test('an axis reaches to the ends of intervals', () => {
	assert.deepEqual(withIntervals([curve([-1, null, 2], [1, null, 13])], 0, 10), [-1, 13]);
	assert.deepEqual(withIntervals([{ ...curve([], []), low: undefined, high: undefined }], 0, 10), [0, 10]);
});

test('a huge interval does not flatten the values', () => {
	assert.deepEqual(withIntervals([curve([-500], [900])], 0, 10), [-10, 20]);
	assert.deepEqual(withIntervals([curve([-500], [900])], 3, 3), [2, 4]);
});
