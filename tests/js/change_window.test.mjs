import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { changedMarkings, changeWindow } from '../../static/geometry/change_window.js';

const state = (lines, balls = []) => ({ included: true, calibration: 'lines', lines, balls });
const view = (before, after) => ({ key: 'a', letter: 'A', width: 1920, height: 1080, image: null, before, after });
const still = { 'Side line top': [{ x: 10, y: 10 }, { x: 1900, y: 12 }] };

describe('changeWindow', () => {
	it('holds what moved, before and after, and not the whole line', () => {
		const before = state({ ...still, 'Middle line': [{ x: 900, y: 500 }, { x: 910, y: 900 }] });
		const after = state({ ...still, 'Middle line': [{ x: 940, y: 510 }, { x: 910, y: 900 }] });
		const { x, y, width, height } = changeWindow(view(before, after));
		assert.ok(x < 900 && x + width > 940 && y < 500 && y + height > 510);
		assert.ok(width < 400);
		assert.deepEqual(changedMarkings(before, after), ['Middle line']);
	});
	it('stays within the picture', () => {
		const ball = (x) => state(still, [{ box: [x, 0, 10, 10], point: null }]);
		const { x, y } = changeWindow(view(ball(0), ball(2)));
		assert.deepEqual([x, y], [0, 0]);
	});
	it('is the whole picture where nothing in it moved, or nothing was there', () => {
		const whole = { x: 0, y: 0, width: 1920, height: 1080 };
		assert.deepEqual(changeWindow(view(state(still), { ...state(still), included: false })), whole);
		assert.deepEqual(changeWindow(view(null, state(still))), whole);
	});
});
