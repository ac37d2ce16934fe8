/** Undo of a verdict names the verdict that it takes back; what was there before is the server's to restore. */

import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/review/7', search: '' });
globalThis.history = /** @type {any} */ ({
	pushState(_state, _title, url) {
		const { pathname, search } = new URL(url, 'http://here');
		Object.assign(location, { pathname, search });
	},
});
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

const { group, groupDocument, takeOver } = await import('../../static/state/group.js');
const { actions, undone } = await import('../../static/state/last_action.js');
const { notice } = await import('../../static/state/notice.js');
const { outbox } = await import('../../static/state/outbox.js');
const { isSending } = await import('../../static/state/sending.js');
const { defer, redoVerdict, undoVerdict } = await import('../../static/state/verdicts.js');

const BEFORE = { state: 'accepted', reason: null, note: null, by: 'anna', at: 'then', stale: true, fixed: false };
const MINE = { state: 'deferred', reason: null, note: null, by: 'local', at: 'now', stale: false, fixed: false };
const view = { key: 'a.png', letter: 'A', lines: {}, balls: [], included: true, station: { id: 1 }, image: null };
const groupOf = (etag, verdict) => ({
	id: 7, number: 4, etag, verdict, verdicts: [], dataset: { id: 1, name: 'd' }, views: [view], solution: null,
});

/** Bodies of the verdicts that were sent. @type {any[]} */
let sent = [];
/** What the server answers to them, one after the other. @type {[number, any][]} */
let answers = [];

globalThis.fetch = async (_path, { method, body }) => {
	let [status, json] = [200, groupDocument.value];
	if (method === 'PUT') {
		sent.push(JSON.parse(body));
		[status, json] = answers.shift() ?? [500, {}];
	}
	return { ok: status < 400, status, headers: new Headers(), json: async () => json };
};

async function settled() {
	do await new Promise((resolve) => { setImmediate(resolve); }); while (isSending.value);
}

beforeEach(() => {
	Object.assign(location, { pathname: '/review/7', search: '' });
	[sent, answers] = [[], []];
	outbox.value = [];
	actions.value = [];
	undone.value = [];
	notice.value = null;
	groupDocument.value = groupOf('a', BEFORE);
});

describe('undo of a verdict', () => {
	it('names the verdict by its time, and shows what is restored as it was', async () => {
		answers = [[200, groupOf('b', MINE)], [200, groupOf('c', BEFORE)]];
		defer();
		await settled();
		assert.equal(actions.value[0].at, 'now');
		const done = undoVerdict(actions.value[0]);
		await done;
		assert.deepEqual(group.value.verdict, BEFORE);
		await settled();
		assert.deepEqual(sent, [{ state: 'deferred', reason: null, note: null }, { state: 'unreviewed', undo_of: 'now' }]);
		assert.deepEqual([actions.value.length, undone.value.length], [0, 1]);
	});

	it('waits for a verdict that is still on its way, and names that', async () => {
		answers = [[200, groupOf('b', MINE)], [200, groupOf('c', BEFORE)]];
		defer();
		await undoVerdict(actions.value[0]);
		assert.equal(undone.value.length, 1);
		await settled();
		assert.deepEqual(sent[1], { state: 'unreviewed', undo_of: 'now' });
		assert.equal(undone.value[0].at, 'now');
	});

	it('leaves the same verdict of a colleague alone', async () => {
		answers = [[200, groupOf('b', MINE)]];
		defer();
		await settled();
		takeOver(groupOf('c', { ...MINE, by: 'anna', at: 'later' }));
		await undoVerdict(actions.value[0]);
		assert.match(notice.value.text, /was reviewed again since; the new verdict stays/);
		assert.equal(sent.length, 1);
	});

	it('says so where the server knows of a newer one', async () => {
		answers = [[200, groupOf('b', MINE)], [409, { title: 'so it stays' }]];
		defer();
		await settled();
		await undoVerdict(actions.value[0]);
		await settled();
		assert.match(notice.value.text, /so it stays/);
		assert.deepEqual([outbox.value, undone.value], [[], []]);
	});
});

describe('redo of a verdict', () => {
	it('names the verdict that it gives again, and can be undone by its own time', async () => {
		const again = { ...MINE, at: 'again' };
		answers = [[200, groupOf('b', MINE)], [200, groupOf('c', BEFORE)], [200, groupOf('d', again)], [200, groupOf('e', BEFORE)]];
		defer();
		await settled();
		await undoVerdict(actions.value[0]);
		await settled();
		await redoVerdict(undone.value[0]);
		await settled();
		assert.deepEqual(sent[2], { state: 'deferred', reason: null, note: null, redo_of: 'now' });
		await undoVerdict(actions.value[0]);
		await settled();
		assert.deepEqual(sent[3], { state: 'unreviewed', undo_of: 'again' });
	});
});
