import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
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

	it('does it once however long it is held, except where it repeats', () => {
		/** @type {string[]} */
		const done = [];
		const binding = (/** @type {string} */ key, /** @type {boolean} */ repeats) => ({ keys: [key], label: key, group: 'Track', repeats, run: () => done.push(key) });
		const unbind = bind([binding('a', false), binding('f', true)]);
		startKeys();
		for (const key of ['a', 'f']) for (const repeat of [false, true, true]) hears.keydown({ ...event, key, code: key, repeat, target: new HTMLElement('DIV'), preventDefault: () => {} });
		assert.deepEqual(done, ['a', 'f', 'f', 'f']);
		unbind();
	});

	it('presses a button that has the focus once', () => {
		let prevented = 0;
		for (const repeat of [false, true, true]) hears.keydown({ ...event, key: 'Enter', code: 'Enter', repeat, target: new HTMLButtonElement('BUTTON'), preventDefault: () => { prevented += 1; } });
		assert.equal(prevented, 2);
	});

	it('repeats only steps and moves, and never what is said of a group or a track', () => {
		const views = new URL('../../static/views/', import.meta.url);
		const files = readdirSync(views, { recursive: true }).filter((name) => name.endsWith('.js'));
		const repeating = files.flatMap((name) => readFileSync(new URL(name, views), 'utf8').split('\n').filter((line) => line.includes('repeats: true')));
		assert.ok(repeating.length > 40);
		const kinds = /label: ['`](?:Next|Previous|Ten|One second|Extend|Move|Show (?:fewer|more)|Closer|Farther|Ball (?:smaller|larger)|The focused view one frame)|when: (?:turns|notScrolling|\(\) => isDrawing)/;
		assert.deepEqual(repeating.filter((line) => !kinds.test(line) || /judge|'review'|'lead'/.test(line)), []);
	});
});
