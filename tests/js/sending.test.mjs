/** What becomes of a write that the server does not take: it waits, or it is told and dropped with what stands on it. */

import assert from 'node:assert/strict';
import { beforeEach, describe, it, mock } from 'node:test';

// A browser without a database for us.
globalThis.IDBRequest = class extends EventTarget {
	error = new Error('none here');
};
globalThis.indexedDB = {
	open() {
		const request = new IDBRequest();
		queueMicrotask(() => request.dispatchEvent(new Event('error')));
		return request;
	},
};
Object.defineProperty(globalThis, 'navigator', { configurable: true, value: { onLine: true } });

const { onRefused } = await import('../../static/state/group.js');
const { notice } = await import('../../static/state/notice.js');
const { enqueue, outbox } = await import('../../static/state/outbox.js');
const { rememberAnswer } = await import('../../static/state/documents.js');
const { busyWith, isAway, isSending, wake } = await import('../../static/state/sending.js');

const edit = { kind: 'include', view: 'a.png', included: false };
const answer = { id: 7, number: 4, etag: 'b', views: [{ key: 'a.png', letter: 'A', station: { id: 1 } }] };

/** Paths that were asked for. @type {string[]} */
let asked = [];

/** @param {number} status @param {any} body @param {Record<string, string>} [headers] */
function answers(status, body, headers = {}) {
	globalThis.fetch = async (path) => {
		asked.push(path);
		return { ok: status < 400, status, headers: new Headers(headers), json: async () => body };
	};
}

/** @param {object} [more] */
function write(more) {
	enqueue({ method: 'PATCH', path: '/views/1', body: {}, etag: 'a', group: 7, station: null, edit, verdict: null, base: null, ...more });
}

const verdict = { state: 'deferred', reason: null, note: null };

/** Until nothing is sent any more. */
async function sent() {
	while (isSending.value) await new Promise((resolve) => { setImmediate(resolve); });
}

beforeEach(() => {
	outbox.value = [];
	asked = [];
	notice.value = null;
	rememberAnswer(answer);
});

describe('a server that is busy', () => {
	for (const status of [503, 507]) {
		it(`keeps what was said, and is asked again when it wants to be (${status})`, async () => {
			mock.timers.enable({ apis: ['setTimeout'] });
			try {
				answers(status, { detail: 'too much to do' }, { 'retry-after': '5' });
				write();
				wake();
				await sent();
				assert.deepEqual([outbox.value.length, isAway.value, busyWith.value, notice.value], [1, true, 'too much to do', null]);
				answers(200, answer);
				mock.timers.tick(4999);
				await sent();
				assert.equal(asked.length, 1);
				mock.timers.tick(1);
				await sent();
				assert.deepEqual([asked.length, outbox.value.length, isAway.value], [2, 0, false]);
			} finally {
				mock.timers.reset();
			}
		});
	}
});

describe('a refusal', () => {
	it('names its group, and is heard by the verdict that waited behind it', async () => {
		/** @type {string[]} */
		const heard = [];
		onRefused(({ path }) => { heard.push(path); });
		answers(422, { detail: 'no such view' });
		write();
		write({ path: '/groups/7/verdict', method: 'PUT', edit: null, verdict });
		wake();
		await sent();
		assert.deepEqual(outbox.value, []);
		assert.deepEqual(heard, ['/views/1', '/groups/7/verdict']);
		assert.equal(notice.value.text, 'Not saved in group 4: no such view. Its verdict is not saved either.');
	});

	it('of a verdict says so once', async () => {
		/** @type {string[]} */
		const heard = [];
		onRefused(({ path }) => { heard.push(path); });
		answers(409, { detail: 'it is frozen', hint: 'Ask a lead.' });
		write({ path: '/groups/7/verdict', method: 'PUT', edit: null, verdict });
		wake();
		await sent();
		assert.deepEqual(heard, ['/groups/7/verdict']);
		assert.equal(notice.value.text, 'Not saved in group 4: it is frozen. Ask a lead.');
	});
});
