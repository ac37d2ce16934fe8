/** What one person likes on one machine, in several tabs. */

import assert from 'node:assert/strict';
import { afterEach, beforeEach, describe, it } from 'node:test';

import { stored } from '../../static/lib/storage.js';

/** What the browser keeps. @type {Map<string, string>} */
let kept;
/** @type {((event: {key: string | null}) => void)[]} */
let listeners;

/** @returns {any} */
const area = () => ({ getItem: (/** @type {string} */ key) => kept.get(key) ?? null, setItem: (/** @type {string} */ key, /** @type {string} */ text) => kept.set(key, text) });

/** Another tab writes something. @param {string} name @param {unknown} value */
function elsewhere(name, value) {
	kept.set(`touchline.${name}`, JSON.stringify(value));
	for (const hear of listeners) hear({ key: `touchline.${name}` });
}

beforeEach(() => {
	kept = new Map();
	listeners = [];
	Object.assign(globalThis, { localStorage: area(), sessionStorage: area(), addEventListener: (/** @type {string} */ kind, /** @type {any} */ hear) => { if (kind === 'storage') listeners.push(hear); } });
});

afterEach(() => {
	for (const name of ['localStorage', 'sessionStorage', 'addEventListener']) Reflect.deleteProperty(globalThis, name);
});

describe('a setting with several parts', () => {
	it('keeps what another tab has put into it', () => {
		const keys = stored('keys', /** @type {Record<string, string>} */ ({}));
		elsewhere('keys', { accept: 'q' });
		keys.value = { ...keys.value, reject: 'y' };
		assert.deepEqual(JSON.parse(kept.get('touchline.keys') ?? ''), { accept: 'q', reject: 'y' });
	});

	it('is the initial one again where the browser has forgotten it, or holds something else', () => {
		const keys = stored('keys', /** @type {Record<string, string>} */ ({}));
		elsewhere('other', { accept: 'q' });
		assert.deepEqual(keys.value, {});
		elsewhere('keys', 7);
		assert.deepEqual(keys.value, {});
	});
});

describe('where somebody is', () => {
	it('is not moved by another tab', () => {
		const last = stored('last-group', 0);
		last.value = 4;
		elsewhere('last-group', 9);
		assert.equal(last.value, 4);
	});
});
