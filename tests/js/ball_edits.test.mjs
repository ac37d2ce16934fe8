import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import {
	expectedDiameter, isOutOfView, newBall, toggleOccluded, toggleOutOfView,
} from '../../static/state/ball_edits.js';

const ball = { box: [10, 20, 8, 12], point: null, occluded: false, out_of_view: false };
const empty = { key: 'b', width: 1280, height: 720, balls: [] };
const seen = { ...empty, key: 'a', balls: [ball] };

describe('newBall', () => {
	it('is a square box about the place', () => {
		assert.deepEqual(newBall(empty, { x: 100, y: 50 }, 10).ball.box, [95, 45, 10, 10]);
	});
});

describe('expectedDiameter', () => {
	it('is what the 3D ball looks like from there', () => {
		const solution = { views: [{ view: 'b', ball: { optimized_diameter_px: 13.5 } }] };
		assert.equal(expectedDiameter({ views: [seen, empty] }, solution, empty), 13.5);
	});

	it('is the size that the other views say, at this view\'s resolution', () => {
		const small = { ...empty, width: 640, height: 360 };
		assert.equal(expectedDiameter({ views: [seen, small] }, null, small), 5);
	});

	it('is something visible where nothing is known', () => {
		assert.ok(expectedDiameter({ views: [empty] }, null, empty) > 6);
	});
});

describe('toggles', () => {
	it('occluded keeps the box', () => {
		const { ball: next } = toggleOccluded(seen);
		assert.deepEqual([next.box, next.occluded], [ball.box, true]);
		assert.equal(toggleOccluded(empty), null);
	});

	it('out of view leaves no box, and is taken back', () => {
		const { ball: out } = toggleOutOfView(seen);
		assert.deepEqual(out, { box: null, point: null, occluded: false, out_of_view: true });
		const gone = { ...seen, balls: [out] };
		assert.ok(isOutOfView(gone));
		assert.deepEqual(toggleOutOfView(gone).ball, ball);
		toggleOutOfView(empty);
		assert.equal(toggleOutOfView({ ...empty, balls: [out] }).ball, null);
	});
});
