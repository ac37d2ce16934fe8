import assert from 'node:assert/strict';
import { test } from 'node:test';

import { pitchSize, shownSize } from '../../static/lib/pitch_size.js';

test('a size is length by width, without zeros that say nothing', () => {
	assert.equal(pitchSize({ length: 105, width: 66.5 }), '105 × 66.5 m');
});

test('what the lines show has its uncertainty, and what they do not show is unknown', () => {
	const estimate = { length: 103.04, width: null, length_sigma_m: 0.11, width_sigma_m: null, frames: 9 };
	assert.equal(shownSize(estimate), 'length 103.0 ± 0.1 m, width unknown');
	assert.equal(shownSize(null), 'not estimated yet');
});
