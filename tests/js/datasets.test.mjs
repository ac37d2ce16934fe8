/** Which dataset is meant where nothing names one. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

globalThis.localStorage = /** @type {any} */ ({ getItem: () => null, setItem() {} });
globalThis.location = /** @type {any} */ ({ pathname: '/groups', search: '' });
const { dataset, datasets } = await import('../../static/state/datasets.js');

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
