import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { pinsOf } from '../../static/lib/pins.js';

describe('pins', () => {
	it('come back as they were written', () => {
		const text = 'B 612,330: behind the post: look';
		assert.deepEqual(pinsOf(`first\n${text}`, 'B'), [{ at: { x: 612, y: 330 }, text: 'behind the post: look' }]);
	});

	it('belong to one view, and other lines to none', () => {
		assert.deepEqual(pinsOf('B 1,2: x', 'A'), []);
		assert.deepEqual(pinsOf('seen on video', 'A'), []);
		assert.deepEqual(pinsOf(null, 'A'), []);
	});
});
