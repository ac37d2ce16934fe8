import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { comparedRows } from '../../static/views/calibration/comparison_rows.js';

const solution = (paint) => ({
	gates: [], ball: null,
	views: [{ view: 'a', ball: null, calibration: { camera: {}, jac: null, error_px: null, markings: [], paint } }],
});
const shares = (before, after) => comparedRows('a', before, after)
	.filter(({ name }) => ['supported', 'explained'].includes(name))
	.map(({ name, before: old, after: next, change }) => [name, old, next, change]);

describe('comparedRows', () => {
	it('compares how the camera and its paint agree', () => {
		const [old, next] = [solution({ supported: 0.4, explained: 0.9 }), solution({ supported: 0.8, explained: 0.7 })];
		assert.deepEqual(shares(old, next), [
			['supported', '40 %', '80 %', 'better'],
			['explained', '90 %', '70 %', 'worse'],
		]);
	});

	it('counts the gates that the review page ticks', () => {
		const gates = [{ active: true, passed: true, value: 2, sentence: '' }, { active: true, passed: true, value: null, sentence: '' }, { active: true, passed: false, value: 1, sentence: '' }];
		const found = comparedRows('a', null, { ...solution(null), gates });
		assert.equal(found.find(({ name }) => name === 'gates')?.after, '1');
	});

	it('has no row for paint that nobody read', () => {
		assert.deepEqual(shares(solution(null), solution(null)), []);
		assert.equal(shares(solution({ supported: 0.4, explained: 0.9 }), solution(null))[0][2], '–');
	});
});
