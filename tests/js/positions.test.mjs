import assert from 'node:assert/strict';
import { afterEach, describe, it } from 'node:test';

import { revertPositions } from '../../static/api/match_estimates.js';

const { fetch } = globalThis;

describe('revertPositions', () => {
	afterEach(() => { globalThis.fetch = fetch; });

	it('is sent under a key, so that a repetition takes back no more', async () => {
		/** @type {any[]} */
		const sent = [];
		globalThis.fetch = /** @type {any} */ (async (/** @type {any[]} */ ...request) => {
			sent.push(request);
			return new Response('{}');
		});
		await revertPositions(3, 'a b');
		const [[address, { method, headers }]] = sent;
		assert.deepEqual([address, method], ['/api/v1/datasets/3/positions?match=a+b', 'DELETE']);
		assert.match(headers['idempotency-key'], /^[0-9a-f]{32}$/);
	});
});
