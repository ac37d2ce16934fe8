/** What the server says is wrong, as people read it. */

import assert from 'node:assert/strict';
import { it } from 'node:test';

import { ApiError, sentenceOf } from '../../static/api/problem.js';

it('names a field as it stands in the form', () => {
	const error = new ApiError(422, { detail: '/password: must have 200 characters or less', pointer: '/password' });
	assert.equal(sentenceOf(error), 'Password: must have 200 characters or less.');
});

it('leaves a place within a request as it is', () => {
	const error = new ApiError(422, { detail: '/lines/Circle left/0: is missing', hint: 'Draw it.' });
	assert.equal(sentenceOf(error), '/lines/Circle left/0: is missing. Draw it.');
});
