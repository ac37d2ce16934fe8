/** Groups as they are read: what is told while one is on its way makes its answer old. */

import assert from 'node:assert/strict';
import test from 'node:test';

import { forgetOthers, known, load, outdate } from '../../static/state/documents.js';

/** Answers that wait to be given, in the order in which they were asked for. */
const asked = [];
globalThis.fetch = () => new Promise((resolve) => {
	asked.push((etag) => resolve({ ok: true, status: 200, headers: new Headers(), json: async () => ({ id: 4, etag, dataset: { name: 'another' }, views: [] }) }));
});
const turn = () => new Promise((resolve) => { setTimeout(resolve); });

test('a group of which something is told while it is read is read again', async () => {
	const wanted = load(4);
	outdate(4);
	asked[0]('old');
	await turn();
	assert.equal(known(4), undefined);
	asked[1]('new');
	assert.equal((await wanted).etag, 'new');
	assert.equal(known(4).etag, 'new');
	assert.equal(asked.length, 2);
});

test('nothing that was told before it was asked for makes an answer old', async () => {
	outdate(4);
	const wanted = load(4);
	asked[2]('newer');
	assert.equal((await wanted).etag, 'newer');
	assert.equal(asked.length, 3);
});

test('where nobody was told for a while, what is on its way is old, too', async () => {
	const wanted = load(4);
	forgetOthers(null);
	asked[3]('old');
	await turn();
	asked[4]('present');
	assert.equal((await wanted).etag, 'present');
});

test('where something changed in one dataset, the groups of others stay ready', async () => {
	const groups = { 5: 'one', 6: 'other', 7: 'one' };
	globalThis.fetch = async (path) => {
		const id = Number(path.split('/').at(-1));
		return { ok: true, status: 200, headers: new Headers(), json: async () => ({ id, etag: 'a', dataset: { name: groups[id] }, views: [] }) };
	};
	for (const id of [5, 6, 7]) await load(id);
	forgetOthers(5, 'one');
	assert.deepEqual([5, 6, 7].map((id) => known(id)?.id), [5, 6, undefined]);
});
