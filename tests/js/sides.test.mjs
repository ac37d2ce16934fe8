import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { framePoints } from '../../static/geometry/frame_points.js';
import { doubt, findingTitle, suggestedReason } from '../../static/state/advice.js';
import { swappedViews, swapWarning } from '../../static/state/sides.js';

const views = ['A', 'B', 'C'].map((letter) => ({ key: letter.toLowerCase(), letter }));
const group = { views };

function solved(places, findings = [], more = {}) {
	return {
		passes: true, first_failing: null, findings, ...more,
		views: places.map((y, i) => ({ view: views[i].key, calibration: { camera: y === null ? null : { position_meters: [0, y, -10] } } })),
	};
}

const named = (view) => ({ kind: 'sides_swapped', view, sentence: 'Left is right.' });

describe('swapWarning', () => {
	it('speaks against sending the main camera across the pitch', () => {
		assert.match(swapWarning(group, solved([60, 40, 50]), views[0]), /A is the main camera/);
	});

	it('speaks against a second camera on the far side', () => {
		assert.match(swapWarning(group, solved([60, -40, 50]), views[2]), /B and C/);
	});

	it('has nothing against the view that a finding names, nor against coming back to the near side', () => {
		assert.equal(swapWarning(group, solved([60, -40, 50], [named('c')]), views[2]), null);
		assert.equal(swapWarning(group, solved([-60, 40, 50]), views[0]), null);
		assert.equal(swapWarning(group, solved([60, 40, 50]), views[1]), null);
		assert.equal(swapWarning(group, solved([60, null, 50]), views[1]), null);
	});

	it('reads the names from the findings', () => {
		assert.deepEqual(swappedViews(solved([60, 40], [named('b'), { kind: 'bad_point', view: 'a' }])), ['b']);
		assert.deepEqual(swappedViews(null), []);
	});
});

describe('advice', () => {
	it('has a reason to reject for every gate that can fail', () => {
		for (const gate of ['calibratable', 'jac', 'two_views', 'ball', 'baseline', 'reprojection', 'parallax', 'sigma']) {
			assert.ok(suggestedReason(solved([60, 40], [], { passes: false, first_failing: { gate } })), gate);
		}
	});

	it('believes a telling finding before the gate', () => {
		const failing = { passes: false, first_failing: { gate: 'reprojection' } };
		assert.equal(suggestedReason(solved([60, 40], [named('b')], failing)), 'sides_confused');
		assert.equal(suggestedReason(solved([60, 40], [], failing)), 'not_same_instant');
		assert.equal(suggestedReason(solved([60, 40])), null);
	});

	it('doubts a group that passes with its sides swapped, and no other', () => {
		assert.match(doubt(solved([60, 40], [named('a')])), /swapped/);
		assert.equal(doubt(solved([60, 40], [{ kind: 'low_parallax', view: null }])), null);
		assert.equal(doubt(null), null);
	});

	it('names the view in the title of a finding', () => {
		assert.equal(findingTitle(group, named('b')), 'Left and right are swapped in B');
		assert.equal(findingTitle(group, { kind: 'brand_new', view: null }), 'Brand new');
	});
});

describe('framePoints', () => {
	it('fills the panel with what is long, and comes no closer than asked to what is short', () => {
		const panel = { width: 700, height: 400 };
		const long = framePoints([{ x: 0, y: 10 }, { x: 980, y: 10 }], panel, 12);
		assert.deepEqual(long.center, { x: 490, y: 10 });
		assert.ok(Math.abs(long.scale - 0.5) < 1e-9);
		assert.equal(framePoints([{ x: 5, y: 5 }, { x: 6, y: 5 }], panel, 12).scale, 12);
	});
});
