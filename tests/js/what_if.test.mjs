/** Thresholds that are tried out stand in the address. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/', search: '' });
const { textsOf, valuesIn } = await import('../../static/state/what_if.js');

const PRESENT = { min_jac: 0.75, max_sigma_m: null, 'calibration.source': 'lines', 'calibration.shared': true };

test('what is written into an address is read from it', () => {
	const values = { min_jac: 0.8, max_sigma_m: 0.5, 'calibration.source': 'paint', 'calibration.shared': false };
	assert.deepEqual(valuesIn(new URLSearchParams(textsOf(values)), PRESENT), values);
	assert.deepEqual(valuesIn(new URLSearchParams(textsOf({ min_jac: null })), PRESENT), { min_jac: null });
});

test('what the saved policy has already, what no threshold is called, and what cannot be read is left out', () => {
	assert.deepEqual(valuesIn(new URLSearchParams('min_jac=0.75&other=1&max_sigma_m=half'), PRESENT), {});
});
