/** Shots that are changed while the list is read again are not lost. */

import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

import { announced, notice } from '../../static/state/notice.js';
import { makeShotList } from '../../static/state/shot_list.js';

const shot = (first, last) => ({ first, last, kind: 'main', entered_by: 'cut', kept: null });
const WHOLE = [shot(0, 59)];
const CUT = [shot(0, 19), shot(20, 59)];
const TWICE = [shot(0, 9), shot(10, 19), shot(20, 59)];

/** Requests that wait for their answer. @type {{method: string, etag: string, answer: (status: number, items: any[], etag: string) => Promise<void>}[]} */
let asked = [];
const turn = () => new Promise((resolve) => { setTimeout(resolve); });

beforeEach(() => {
	asked = [];
	notice.value = null;
	globalThis.fetch = /** @type {any} */ ((_path, { method, headers }) => new Promise((resolve) => {
		asked.push({
			method, etag: headers['if-match'], answer: (status, items, etag) => {
				resolve({ ok: status < 400, status, headers: new Headers(), json: async () => ({ items, etag }) });
				return turn();
			},
		});
	}));
});

async function opened() {
	const shots = makeShotList(1);
	shots.read();
	await turn();
	await asked.shift().answer(200, WHOLE, 'a');
	assert.deepEqual(shots.list.value.items, WHOLE);
	return shots;
}

describe('a list of shots', () => {
	it('says that there is nothing to undo', async () => {
		const shots = await opened();
		shots.undo();
		assert.deepEqual(announced.value, { text: 'There is nothing to undo.', shown: true });
		assert.equal(asked.length, 0);
	});

	it('keeps what was changed while it was read', async () => {
		const shots = await opened();
		shots.read();
		await turn();
		shots.change(CUT, 'Cut.');
		await turn();
		const [got, put] = asked;
		await got.answer(200, WHOLE, 'a');
		assert.deepEqual(shots.list.value.items, CUT);
		await put.answer(200, CUT, 'b');
		assert.deepEqual(shots.list.value, { items: CUT, etag: 'b' });
	});

	it('is read once what was changed has arrived', async () => {
		const shots = await opened();
		shots.change(CUT, 'Cut.');
		shots.read();
		await turn();
		assert.deepEqual(asked.map(({ method }) => method), ['PUT']);
		await asked[0].answer(200, CUT, 'b');
		assert.deepEqual(asked.map(({ method }) => method), ['PUT', 'GET']);
		await asked[1].answer(200, TWICE, 'c');
		assert.deepEqual(shots.list.value, { items: TWICE, etag: 'c' });
	});

	it('is not read between two changes that are on their way', async () => {
		const shots = await opened();
		shots.change(CUT, 'Cut.');
		shots.read();
		shots.change(TWICE, 'Cut.');
		await turn();
		await asked[0].answer(200, CUT, 'b');
		assert.deepEqual(asked.map(({ method, etag }) => [method, etag]), [['PUT', 'a'], ['PUT', 'b']]);
		await asked[1].answer(200, TWICE, 'c');
		await asked[2].answer(200, TWICE, 'c');
		assert.deepEqual(shots.list.value, { items: TWICE, etag: 'c' });
	});

	it('shows the new state where another person was first, and drops what was changed in the old one', async () => {
		const shots = await opened();
		announced.value = { text: '', shown: false };
		shots.change(CUT, 'Cut.');
		shots.change(TWICE, 'Cut.');
		await turn();
		await asked[0].answer(412, [], '');
		assert.equal(notice.value.text, 'The shots changed in another window or by another person; the page shows the new state.');
		await asked[1].answer(200, WHOLE, 'd');
		assert.deepEqual([shots.list.value, asked.length], [{ items: WHOLE, etag: 'd' }, 2]);
		assert.equal(announced.value.text, '');
		shots.undo();
		await turn();
		assert.equal(asked.length, 2);
	});
});
