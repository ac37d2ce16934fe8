import assert from 'node:assert/strict';
import { test } from 'node:test';

import { isNewPicture } from '../../static/views/picture_proposal.js';

const wide = { aspect: 1.06, shift: [0, 0], sigma: [0.01, 0.01, 0.01] };

test('a proposal is new until all frames of the match have it', () => {
	assert.equal(isNewPicture({ picture: null, mixed: false }, wide), true);
	assert.equal(isNewPicture({ picture: wide, mixed: true }, wide), true);
	assert.equal(isNewPicture({ picture: wide, mixed: false }, wide), false);
	assert.equal(isNewPicture({ picture: null, mixed: true }, null), false);
});
