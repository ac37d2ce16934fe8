/** Which dataset is meant where nothing names one. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

globalThis.localStorage = /** @type {any} */ ({ getItem: () => null, setItem() {} });
globalThis.location = /** @type {any} */ ({ pathname: '/groups', search: '' });
const { dataset, datasets, useDataset } = await import('../../static/state/datasets.js');

test('nobody is sent to a practice who did not ask for it', () => {
	for (const name of ['practice', 'practice ana', 'recording practice', 'recording practice ana']) {
		datasets.value = [{ name }, { name: 'sample' }];
		assert.equal(dataset.value?.name, 'sample', name);
	}
	for (const name of ['practices', 'recording', 'match practice']) {
		datasets.value = [{ name }, { name: 'sample' }];
		assert.equal(dataset.value?.name, name);
	}
	datasets.value = [{ name: 'practice' }];
	assert.equal(dataset.value?.name, 'practice');
});

test('a dataset that was made since the list was read is read when it is meant', async () => {
	let asked = 0;
	globalThis.fetch = async () => {
		asked += 1;
		return Response.json({ items: [{ name: 'sample' }, { name: 'new' }] });
	};
	datasets.value = [{ name: 'sample' }];
	useDataset('sample');
	assert.equal(asked, 0);
	useDataset('new');
	while (datasets.value?.length !== 2) await new Promise((resolve) => { setTimeout(resolve); });
	assert.equal(dataset.value?.name, 'new');
});
