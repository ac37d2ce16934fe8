/** What would make a group pass: a group that is gone says nothing of the others. */

import assert from 'node:assert/strict';
import test from 'node:test';

import { groupDocument } from '../../static/state/group.js';
import { isSearching, remedies, startInsight } from '../../static/state/insight.js';

test('one group without an answer does not end the suggestions of others', async () => {
	/** @type {string[]} */
	const asked = [];
	globalThis.fetch = async (path) => {
		asked.push(path);
		const found = !path.includes('/7/');
		return { ok: found, status: found ? 200 : 404, headers: new Headers(), json: async () => ({ items: ['swap'] }) };
	};
	const searched = async () => { while (isSearching.value) await new Promise((resolve) => { setTimeout(resolve, 20); }); };
	startInsight();
	groupDocument.value = /** @type {any} */ ({ id: 7, etag: 'a', views: [], solution: { passes: false, views: [] } });
	await searched();
	groupDocument.value = /** @type {any} */ ({ id: 8, etag: 'a', views: [], solution: { passes: false, views: [] } });
	await searched();
	assert.equal(asked.length, 2);
	assert.deepEqual(remedies.value?.items, ['swap']);
});
