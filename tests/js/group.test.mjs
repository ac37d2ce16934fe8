/** The group on screen: an answer about another one never takes its place. */

import assert from 'node:assert/strict';
import test from 'node:test';

import { load } from '../../static/state/documents.js';
import { groupDocument, open, renew } from '../../static/state/group.js';

/** Answers that wait to be given, by group. @type {Map<string, (etag: string) => void>} */
const asked = new Map();
globalThis.fetch = (path) => new Promise((resolve) => {
	const id = path.split('/').at(-1);
	asked.set(id, (etag) => resolve({
		ok: true, status: 200, headers: new Headers(), json: async () => ({ id: Number(id), etag, views: [] }),
	}));
});

/** @param {number} id @param {string} etag */
async function answer(id, etag) {
	asked.get(String(id))(etag);
	await new Promise((resolve) => { setTimeout(resolve); });
}

test('a late answer about the group before does not stand where the next one is waited for', async () => {
	open(6);
	await answer(6, 'a');
	assert.equal(groupDocument.value.id, 6);
	// As when somebody else has changed it.
	load(6).then(renew);
	const next = open(1);
	assert.equal(groupDocument.value, null);
	await answer(6, 'b');
	assert.equal(groupDocument.value, null);
	await answer(1, 'c');
	await next;
	assert.deepEqual([groupDocument.value.id, groupDocument.value.etag], [1, 'c']);
});

test('a newer state of the group on screen is shown, an older address is not gone back to', async () => {
	load(1).then(renew);
	await answer(1, 'd');
	assert.equal(groupDocument.value.etag, 'd');
	const first = open(8);
	const second = open(9);
	await answer(9, 'f');
	await answer(8, 'e');
	await Promise.all([first, second]);
	assert.deepEqual([groupDocument.value.id, groupDocument.value.etag], [9, 'f']);
});
