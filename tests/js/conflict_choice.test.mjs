/** Who chooses between two versions loses nothing of what they said, and gets nothing back that they took back. */

import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/review/7', search: '' });
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

const { conflict, keepMine, takeTheirs } = await import('../../static/state/conflict.js');
const { groupDocument, submit, submitDismissal, submitTurn, takeOver } = await import('../../static/state/group.js');
const { actions, undone } = await import('../../static/state/last_action.js');
const { notice } = await import('../../static/state/notice.js');
const { outbox } = await import('../../static/state/outbox.js');
const { isSending } = await import('../../static/state/sending.js');

const POINTS = [{ x: 1, y: 2 }, { x: 3, y: 4 }];
const NONE = { state: 'unreviewed', reason: null, note: null };
const FINDING = { kind: 'too_few_views', view: null, marking: null, suggested: null, number: null };
const viewOf = (lines) => ({ id: 1, key: 'a.png', letter: 'A', lines, balls: [], included: true, station: { id: 3, shared: false }, image: null });
const groupOf = (etag, lines = {}) => ({
	id: 7, number: 4, etag, verdict: NONE, verdicts: [], dataset: { id: 1, name: 'd' }, views: [viewOf(lines)], solution: null,
});
const THEIRS = groupOf('b', { 'Middle line': POINTS });
const hide = { kind: 'lines', view: 'a.png', lines: { 'Side line top': null }, notVisible: ['Side line top'] };
const draw = { kind: 'lines', view: 'a.png', lines: { 'Side line top': POINTS } };

/** What was sent. @type {{method: string, path: string, etag: string, body: any}[]} */
let sent = [];
globalThis.fetch = async (path, { method, headers, body }) => {
	sent.push({ method, path, etag: headers['if-match'], body: body && JSON.parse(body) });
	const isOld = headers['if-match'] === 'a';
	const [status, json] = isOld ? [412, { detail: 'changed', current: THEIRS }] : [200, THEIRS];
	return { ok: status < 400, status, headers: new Headers(), json: async () => json };
};

async function settled() {
	do await new Promise((resolve) => { setImmediate(resolve); }); while (isSending.value);
}

beforeEach(() => {
	sent = [];
	outbox.value = [];
	actions.value = [];
	undone.value = [];
	notice.value = null;
	takeOver(groupOf('a'));
});

describe('a conflict', () => {
	it('keeps that a marking is not visible', async () => {
		groupDocument.value = groupOf('a');
		submit(hide);
		await settled();
		assert.equal(conflict.value.fields.length, 1);
		keepMine();
		await settled();
		assert.deepEqual(sent.at(-1).body, { lines: { 'Side line top': null }, not_visible: ['Side line top'] });
		assert.deepEqual([sent.length, sent.at(-1).etag, outbox.value], [2, 'b', []]);
	});

	it('is none about an edit that was taken back before it was saved', async () => {
		groupDocument.value = groupOf('a');
		submit(draw);
		undone.value = [{ kind: 'edit', dataset: 'd', group: 7, number: 4, times: 1 }];
		submitTurn('undo');
		await settled();
		assert.deepEqual([conflict.value, outbox.value, undone.value], [null, [], []]);
		assert.equal(sent.length, 1);
		assert.equal(groupDocument.value.etag, 'b');
	});

	it('is about the edits before one that was taken back, and those that were made again', async () => {
		groupDocument.value = groupOf('a');
		for (const edit of [hide, draw]) submit(edit);
		for (const verb of ['undo', 'undo', 'redo']) submitTurn(verb);
		await settled();
		assert.deepEqual(conflict.value.fields.map(({ mine }) => mine), [{ points: null, hidden: true }]);
		keepMine();
		await settled();
		assert.deepEqual(sent.map(({ method }) => method), ['PATCH', 'PATCH']);
	});

	it('does not lose the dismissal of a finding behind it, whichever version is chosen', async () => {
		for (const choose of [keepMine, takeTheirs]) {
			sent = [];
			groupDocument.value = groupOf('a');
			submit(draw);
			submitDismissal(FINDING, true);
			await settled();
			assert.equal(sent.length, 1);
			choose();
			await settled();
			assert.deepEqual(sent.at(-1), { method: 'PUT', path: '/api/v1/groups/7/dismissal', etag: 'b', body: { ...FINDING, dismissed: true } });
			assert.deepEqual(outbox.value, []);
		}
	});

	it('lets the dismissal of a finding go on behind an edit that was taken back', async () => {
		groupDocument.value = groupOf('a');
		submit(draw);
		submitTurn('undo');
		submitDismissal(FINDING, false);
		await settled();
		assert.deepEqual([conflict.value, outbox.value], [null, []]);
		assert.deepEqual(sent.map(({ method, etag }) => [method, etag]), [['PATCH', 'a'], ['PUT', 'b']]);
	});
});
