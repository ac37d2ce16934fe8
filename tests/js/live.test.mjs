/** What changes elsewhere: only what concerns the group on screen has it read again. */

import assert from 'node:assert/strict';
import test from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/review/7', search: '' });
globalThis.document = /** @type {any} */ ({ hidden: false, addEventListener() {}, removeEventListener() {}, documentElement: { dataset: {}, hasAttribute: () => false } });
Object.defineProperty(globalThis, 'navigator', { configurable: true, value: {} });
/** @type {any} */
let stream;
globalThis.EventSource = /** @type {any} */ (class {
	kinds = /** @type {any} */ ({});
	constructor() { stream = this; }
	addEventListener(kind, hear) { this.kinds[kind] = hear; }
	close() {}
});

const { known, load } = await import('../../static/state/documents.js');
const { open } = await import('../../static/state/group.js');
const { startLive } = await import('../../static/state/live.js');

/** @type {number[]} */
let asked = [];
globalThis.fetch = /** @type {any} */ (async (path) => {
	const id = Number(path.split('/').at(-1));
	asked.push(id);
	return { ok: true, status: 200, headers: new Headers(), json: async () => ({ id, etag: 'a', dataset: { id: 1, name: 'd' }, views: [] }) };
});
const turn = () => new Promise((resolve) => { setTimeout(resolve); });
const tell = (/** @type {string} */ dataset) => stream.kinds.dataset({ data: JSON.stringify({ dataset }) });

test('a change of another dataset has nothing read again, one of its own has', async () => {
	await open(7);
	await load(8);
	startLive();
	asked = [];
	tell('other');
	await turn();
	assert.deepEqual([asked, known(8)?.id], [[], 8]);
	tell('d');
	await turn();
	assert.deepEqual([asked, known(8)], [[7], undefined]);
});
