import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { otherShape } from '../../static/views/frame.js';

const annotated = { width: 1280, height: 720 };

describe('otherShape', () => {
	it('is silent while nothing is loaded, and about the same shape in another resolution', () => {
		assert.equal(otherShape(null, annotated), '');
		for (const [width, height] of [[1280, 720], [1920, 1080], [398, 224]]) {
			assert.equal(otherShape({ width, height }, annotated), '');
		}
	});

	it('says both sizes where the shapes differ', () => {
		assert.match(otherShape({ width: 720, height: 1280 }, annotated), /^The picture is 720 × 1280, annotated 1280 × 720:/);
	});
});
