import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { doubt, suggestedReason } from '../../static/state/advice.js';

const failing = (gate, ...kinds) => ({
	passes: false, first_failing: { gate }, findings: kinds.map((kind) => ({ kind, sentence: kind })),
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

	it('is none for a group that passes, or was never solved', () => {
		assert.equal(suggestedReason({ passes: true, first_failing: null, findings: [] }), null);
		assert.equal(suggestedReason(null), null);
	});
});

describe('doubt', () => {
	it('names swapped sides of a group that passes, and nothing of one that fails', () => {
		const findings = [{ kind: 'sides_swapped', sentence: 'A fits mirrored.' }];
		assert.match(doubt({ passes: true, findings }), /swapped: A fits mirrored\./);
		assert.equal(doubt({ passes: false, findings }), null);
		assert.equal(doubt({ passes: true, findings: [] }), null);
	});
});
