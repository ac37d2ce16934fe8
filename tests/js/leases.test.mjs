/** A group of a batch is handed in once, and nobody is led away from another group. */

import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/review/7', search: '?q=batch:1' });
globalThis.history = /** @type {any} */ ({
	pushState(_state, _title, url) {
		const { pathname, search } = new URL(url, 'http://here');
		Object.assign(location, { pathname, search });
	},
});

const { canSubmit, lease, startLeases, submitAndOpenNext } = await import('../../static/state/leases.js');
const { notice } = await import('../../static/state/notice.js');
const { outbox } = await import('../../static/state/outbox.js');
const { isAway } = await import('../../static/state/sending.js');
const { navigate } = await import('../../static/lib/router.js');

const batch = { id: 1, name: 'B', groups: 2, settled: 0 };
const item = { id: 'k', group: 7, edit: {}, verdict: null, held: false };
/** What was asked for. @type {string[]} */
let asked = [];

beforeEach(() => {
	asked = [];
	notice.value = null;
	navigate('/review/7?q=batch:1');
	lease.value = /** @type {any} */ ({ batch: 1, group: 7, state: 'mine', part: 'annotator', here: [], sentence: '' });
	globalThis.fetch = async (path, { method }) => {
		asked.push(`${method} ${path.replace('/api/v1', '')}`);
		return { ok: true, status: 200, headers: new Headers(), json: async () => ({ group: 8, batch, part: 'annotator', here: [] }) };
	};
});

describe('submitting a group', () => {
	it('is done once, however often the key is pressed', async () => {
		assert.ok(canSubmit.value);
		await Promise.all([submitAndOpenNext(), submitAndOpenNext()]);
		assert.deepEqual(asked.map((one) => one.split(' ')[0]), ['PUT', 'POST']);
		assert.equal(location.pathname, '/review/8');
	});

	it('waits for what is not saved, says so, and leaves who has gone on where they are', async () => {
		outbox.value = /** @type {any} */ ([item]);
		isAway.value = true;
		const done = submitAndOpenNext();
		assert.equal(notice.value?.text, 'This group is submitted as soon as its changes are saved.');
		assert.deepEqual(asked, []);
		navigate('/review/9?q=batch:1');
		outbox.value = [];
		isAway.value = false;
		await done;
		assert.deepEqual(asked.map((one) => one.split(' ')[0]), ['PUT']);
		assert.equal(location.pathname, '/review/9');
	});
});

describe('a lease', () => {
	it('stays while its group is looked at, in the calibration editor too', async () => {
		const deaf = { addEventListener: () => {}, removeEventListener: () => {} };
		// A page that nobody looks at hears of nothing.
		Object.assign(globalThis, deaf, { document: { ...deaf, hidden: true } });
		startLeases();
		for (const place of ['7/calibration?view=a.png&', '7/calibration?view=b.png&', '7?', '7?view=a.png&']) {
			navigate(`/review/${place}q=batch:1`);
		}
		assert.equal(lease.value?.group, 7);
		assert.deepEqual(asked, []);
		navigate('/review/7/history?q=batch:1');
		assert.equal(lease.value, null);
		assert.deepEqual(asked, ['DELETE /batches/1/groups/7/lease']);
		navigate('/review/9?q=batch:1');
		assert.equal(asked.at(-1), 'PUT /batches/1/groups/9/lease');
		navigate('/groups');
	});

	it('is taken again where another tab of the same person ended it, and not while the group is left', async (t) => {
		/** @type {any} */
		let stream;
		globalThis.EventSource = /** @type {any} */ (class {
			kinds = /** @type {any} */ ({});
			constructor() { stream = this; }
			addEventListener(kind, hear) { this.kinds[kind] = hear; }
			close() {}
		});
		globalThis.document.hidden = false;
		Object.defineProperty(globalThis, 'navigator', { configurable: true, value: { onLine: true } });
		t.after(() => { outbox.value = []; navigate('/groups'); });
		const tell = (here) => stream.kinds.work({ data: JSON.stringify({ batch: 1, group: 7, here }) });
		navigate('/groups');
		navigate('/review/7?q=batch:1');
		await new Promise((resolve) => { setTimeout(resolve); });
		assert.equal(lease.value?.state, 'mine');
		asked = [];
		tell([{ person: 'local', since: '' }]);
		assert.deepEqual(asked, []);
		tell([]);
		assert.deepEqual(asked, ['PUT /batches/1/groups/7/lease']);
		asked = [];
		outbox.value = /** @type {any} */ ([{ ...item, verdict: {} }]);
		tell([]);
		outbox.value = [];
		assert.deepEqual(asked, []);
	});
});
