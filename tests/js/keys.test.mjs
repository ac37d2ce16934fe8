import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { bind, chooseKey, chordOf, isEditable, isLetter, keysOf, startKeys } from '../../static/lib/keys.js';

const event = { key: 'a', code: 'KeyA', ctrlKey: false, metaKey: false, altKey: false, shiftKey: false };

describe('chordOf', () => {
	it('names modifiers in one order and digits by their key', () => {
		assert.equal(chordOf({ ...event, key: 'Z', code: 'KeyZ', ctrlKey: true, shiftKey: true }), 'Ctrl+Shift+z');
		assert.equal(chordOf({ ...event, key: '!', code: 'Digit1', shiftKey: true }), 'Shift+1');
		assert.equal(chordOf({ ...event, key: '?', code: 'Slash', shiftKey: true }), '?');
	});
});

describe('isLetter', () => {
	it('is true for letters alone, with Shift or without', () => {
		assert.deepEqual(['a', 'Shift+a', 'ö', 'Ctrl+a', '1', '?', 'Enter'].map(isLetter), [true, true, true, false, false, false, false]);
	});
});

describe('chooseKey', () => {
	const accept = { keys: ['a', 'Ctrl+Enter'], label: 'Accept', group: 'Verdict', run: () => {} };
	const defer = { keys: ['s'], label: 'Defer', group: 'Verdict', run: () => {} };
	bind([accept, defer]);

	it('takes another key, and gives ours back', () => {
		assert.equal(chooseKey(accept, 'k'), null);
		assert.deepEqual(keysOf(accept), ['k']);
		assert.equal(chooseKey(accept, null), null);
		assert.deepEqual(keysOf(accept), ['a', 'Ctrl+Enter']);
	});

	it('names who has the key and changes nothing', () => {
		assert.equal(chooseKey(accept, 's'), defer);
		assert.deepEqual(keysOf(accept), ['a', 'Ctrl+Enter']);
	});

	it('leaves Escape and what is only explained alone', () => {
		assert.ok(isEditable(accept));
		assert.ok(!isEditable({ ...accept, keys: ['Escape'] }));
		assert.ok(!isEditable({ ...accept, keys: [] }));
	});
});

describe('a key', () => {
	/** @type {Record<string, (event: any) => void>} */
	const hears = {};
	class HTMLElement {
		/** @param {string} tagName */
		constructor(tagName) { this.tagName = tagName; }
	}
	const kinds = ['HTMLAnchorElement', 'HTMLButtonElement', 'HTMLInputElement', 'HTMLTextAreaElement', 'HTMLSelectElement'];
	Object.assign(globalThis, {
		HTMLElement, ...Object.fromEntries(kinds.map((kind) => [kind, class extends HTMLElement {}])),
		addEventListener: (/** @type {string} */ name, /** @type {any} */ hear) => { hears[name] = hear; },
		document: { querySelector: () => null },
	});

	it('opens the summary that has the focus, and does nothing else', () => {
		let runs = 0;
		const unbind = bind([{ keys: ['Enter', ' '], label: 'Open the group', group: 'Track', run: () => { runs += 1; } }]);
		startKeys();
		for (const [tag, key] of [['SUMMARY', 'Enter'], ['SUMMARY', ' '], ['DIV', 'Enter']]) {
			hears.keydown({ ...event, key, code: key, target: new HTMLElement(tag), preventDefault: () => {} });
		}
		assert.equal(runs, 1);
		unbind();
	});
});
