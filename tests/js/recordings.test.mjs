/** Addresses of a recording's frames. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { frameAddress } from '../../static/api/recordings.js';

test('the address of a frame is another one once its recording is another film', () => {
	const [one, other] = ['a', 'b'].map((letter) => frameAddress({ id: 3, sha256: letter.repeat(64) }, 7, 160));
	assert.equal(one, '/api/v1/recordings/3/frames/7?width=160&v=aaaaaaaaaaaa');
	assert.notEqual(one, other);
	assert.equal(frameAddress({ id: 3, sha256: null }, 7, 160), '/api/v1/recordings/3/frames/7?width=160');
});
