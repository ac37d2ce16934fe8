/** What is staged in the calibration editor is kept until it can be saved. */

import assert from 'node:assert/strict';
import test from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/review/7/calibration', search: '' });

const { changed, commit, lines, stageLines } = await import('../../static/state/calibration.js');
const { groupDocument } = await import('../../static/state/group.js');
const { me } = await import('../../static/state/me.js');
const { notice } = await import('../../static/state/notice.js');
const { outbox } = await import('../../static/state/outbox.js');

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
