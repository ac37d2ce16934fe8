/** A queue that could not be read is read again: by a button, and where something happens to its groups. */

import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/groups', search: '?dataset=d&q=status:deferred' });
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

const { datasets } = await import('../../static/state/datasets.js');
const { openQueue, queue } = await import('../../static/state/queue.js');
const { followQueue } = await import('../../static/state/queue_live.js');
const { QueueEmpty } = await import('../../static/views/queue_empty.js');

const one = /** @type {any} */ ({ id: 1, name: 'd' });
const Q = 'status:deferred';
/** What the server answers about groups. @type {number} */
let status = 200;
/** @type {string[]} */
let asked = [];
globalThis.fetch = /** @type {any} */ (async (path) => {
	asked.push(path);
	const json = path.endsWith('/datasets') ? { items: [one] } : { items: [{ id: 5 }], total: 1, progress: {}, detail: 'no' };
	const given = path.endsWith('/datasets') ? 200 : status;
	return { ok: given < 400, status: given, headers: new Headers(), json: async () => json };
});
const turn = () => new Promise((resolve) => { setTimeout(resolve, 20); });

/** The first element of a kind in what is drawn. @param {any} node @param {string} type @returns {any} */
function find(node, type) {
	if (Array.isArray(node)) return node.map((child) => find(child, type)).find(Boolean);
	if (!node || typeof node !== 'object') return undefined;
	return node.type === type ? node : find(node.props?.children, type);
}

/** Open the queue while the server answers so. @param {number} answer */
async function fail(answer) {
	status = answer;
	await openQueue(one, Q);
	assert.equal(queue.value.error?.status, answer);
	[status, asked] = [200, []];
}

beforeEach(() => {
	datasets.value = [one];
});

describe('a queue that the server could not give', () => {
	it('is opened again with the same query by a button', async () => {
		await fail(503);
		const button = find(QueueEmpty({ q: Q }), 'button');
		assert.equal(button.props.children, 'Try again');
		button.props.onClick();
		await turn();
		assert.deepEqual([queue.value.error, queue.value.q, queue.value.total], [null, Q, 1]);
	});

	it('comes back by itself once something happens to its groups', async () => {
		await fail(503);
		const stop = followQueue(one);
		stream.kinds.group({ data: '{"group": 5, "dataset": "d"}' });
		await turn();
		stop();
		assert.equal(queue.value.error, null);
	});

	it('offers all groups where it is the query that cannot be read, and does not ask again', async () => {
		await fail(422);
		const drawn = QueueEmpty({ q: Q });
		assert.equal(find(drawn, 'button'), undefined);
		assert.equal(find(drawn, 'a').props.children, 'Show all groups');
		const stop = followQueue(one);
		stream.kinds.group({ data: '{"group": 5, "dataset": "d"}' });
		await turn();
		stop();
		assert.deepEqual(asked, []);
	});
});
