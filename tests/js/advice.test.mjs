import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { doubt, isGrave, suggestedReason } from '../../static/state/advice.js';

const failing = (gate, ...kinds) => ({
	passes: false, views: [{}, {}], first_failing: { gate }, findings: kinds.map((kind) => ({ kind, sentence: kind })),
});

describe('suggestedReason', () => {
	for (const [gate, reason] of Object.entries({
		calibratable: 'bad_field_lines', jac: 'bad_field_lines', agreement: 'bad_field_lines', two_views: 'bad_field_lines',
		ball: 'ball_not_visible', baseline: 'duplicate_view', reprojection: 'not_same_instant', parallax: 'duplicate_view',
		sigma: 'bad_calibration', chi_square: 'not_same_instant',
	})) {
		it(`is ${reason} where nothing but the gate ${gate} is known`, () => {
			assert.equal(suggestedReason(failing(gate)), reason);
		});
	}

	for (const [kind, reason] of Object.entries({
		camera_size: 'bad_calibration', sides_swapped: 'sides_confused', not_synchronous: 'not_same_instant', views_contradict: 'not_same_instant',
	})) {
		it(`is ${reason} where ${kind} was found, whatever fails`, () => {
			assert.equal(suggestedReason(failing('sigma', 'ball_size', kind)), reason);
		});
	}

	it('is none for a view alone, which no reason to reject is true of', () => {
		assert.equal(suggestedReason({ ...failing('two_views'), views: [{}] }), null);
	});

	it('is none for a group that passes, or was never solved', () => {
		assert.equal(suggestedReason({ passes: true, first_failing: null, findings: [] }), null);
		assert.equal(suggestedReason(null), null);
	});
});

describe('isGrave', () => {
	it('is what makes the ball unusable, and views that disagree in a group that passes', () => {
		assert.equal(isGrave({ kind: 'high_uncertainty', unusable_ball: true }, { passes: false }), true);
		assert.equal(isGrave({ kind: 'high_uncertainty', unusable_ball: false }, { passes: true }), false);
		for (const kind of ['view_disagrees', 'views_contradict', 'sides_swapped', 'not_synchronous']) {
			assert.deepEqual([true, false].map((passes) => isGrave({ kind, unusable_ball: false }, { passes })), [true, false]);
		}
	});
});

describe('doubt', () => {
	it('names what makes the ball unusable, whatever else there is', () => {
		const findings = [{ kind: 'implausible_ball', sentence: 'It lies 10.20 m below the grass. Check it.', unusable_ball: true }];
		for (const passes of [true, false]) assert.equal(doubt({ passes, findings }), 'the ball cannot be used: it lies 10.20 m below the grass');
	});

	it('names swapped sides of a group that passes, and nothing of one that fails', () => {
		const findings = [{ kind: 'sides_swapped', sentence: 'A fits mirrored.' }];
		assert.match(doubt({ passes: true, findings }), /swapped: A fits mirrored\./);
		assert.equal(doubt({ passes: false, findings }), null);
		assert.equal(doubt({ passes: true, findings: [] }), null);
	});
});
