/** What is staged in the calibration editor is kept until it can be saved. */

import assert from 'node:assert/strict';
import test from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/review/7/calibration', search: '' });

// A browser without a database for us.
globalThis.IDBRequest = class extends EventTarget {
	error = new Error('none here');
};
globalThis.indexedDB = /** @type {any} */ ({
	open() {
		const request = new IDBRequest();
		queueMicrotask(() => request.dispatchEvent(new Event('error')));
		return request;
	},
});
Object.defineProperty(globalThis, 'navigator', { configurable: true, value: { onLine: true } });

const { changed, changes, commit, discardStaged, lines, stageLines, staging } = await import('../../static/state/calibration.js');
const { groupDocument, submit, submitTurn, takeOver } = await import('../../static/state/group.js');
const { me } = await import('../../static/state/me.js');
const { notice } = await import('../../static/state/notice.js');
const { outbox } = await import('../../static/state/outbox.js');
const { isSending } = await import('../../static/state/sending.js');
const { PROPOSED, proposedLines } = await import('../../static/state/staging.js');

test('who may only read keeps what they staged, and is told why it is not saved', () => {
	const view = { id: 1, key: 'a.png', letter: 'A', lines: {}, balls: [], included: true, station: { id: 3, shared: false } };
	groupDocument.value = /** @type {any} */ ({ id: 7, etag: 'a', number: 4, dataset: { name: 'd' }, views: [view] });
	me.value = /** @type {any} */ ({ name: 'rita', team: true, role: 'reader', allows: { reader: ['read'], annotator: ['read', 'annotate'] } });
	const staged = { 'Middle line': [{ x: 1, y: 2 }, { x: 3, y: 4 }] };
	stageLines(staged, 'Middle line drawn');
	assert.equal(commit(), false);
	assert.ok(changed.value);
	assert.deepEqual([lines.value, outbox.value], [staged, []]);
	assert.equal(notice.value?.text, 'Editing needs the role annotator in d; yours is reader.');
});

const LINE = [{ x: 1, y: 2 }, { x: 3, y: 4 }];
const OTHER = [{ x: 5, y: 6 }, { x: 7, y: 8 }];

/** A group on screen of somebody who may edit, and a server that refuses what they save. @param {number} status */
function refusing(status) {
	me.value = null;
	const view = { id: 1, key: 'a.png', letter: 'A', lines: { 'Goal left crossbar': OTHER }, balls: [], included: true, station: { id: 3, shared: false } };
	const at = /** @type {any} */ ({ id: 7, etag: 'a', number: 4, dataset: { name: 'd' }, verdict: { state: 'unreviewed' }, views: [view], solution: null });
	groupDocument.value = at;
	takeOver(at);
	discardStaged();
	globalThis.fetch = /** @type {any} */ (async () => ({ ok: false, status, headers: new Headers(), json: async () => ({ detail: 'You have submitted this group' }) }));
}

async function settled() {
	do await new Promise((resolve) => { setImmediate(resolve); }); while (isSending.value);
}

for (const status of [409, 422, 429, 500]) {
	test(`what the server does not save is staged again (${status})`, async () => {
		refusing(status);
		stageLines({ 'Middle line': LINE }, 'Middle line drawn');
		assert.ok(commit());
		assert.equal(staging.value.steps.length, 0);
		await settled();
		assert.deepEqual(outbox.value, []);
		assert.deepEqual(changes.value, { 'Goal left crossbar': null, 'Middle line': LINE });
		assert.match(notice.value?.text ?? '', /You have submitted this group/);
	});
}

test('what was staged since stays on top of it, and what is as proposed stays so', async () => {
	refusing(409);
	const first = { ...lines.value, 'Middle line': LINE };
	stageLines(first, 'Lines proposed from the paint', PROPOSED);
	commit();
	stageLines({ ...first, 'Middle line': OTHER, 'Side line top': LINE }, 'Side line top drawn');
	await settled();
	assert.deepEqual(changes.value, { 'Middle line': OTHER, 'Side line top': LINE });
	assert.deepEqual(proposedLines(staging.value), { 'Middle line': LINE });
});

test('what was taken back before it was saved, or drawn elsewhere, is not staged', async () => {
	refusing(409);
	stageLines({ ...lines.value, 'Middle line': LINE }, 'Middle line drawn');
	commit();
	submitTurn('undo');
	submit({ kind: 'lines', view: 'a.png', lines: { 'Side line top': LINE } });
	await settled();
	assert.deepEqual([outbox.value, changed.value], [[], false]);
});
