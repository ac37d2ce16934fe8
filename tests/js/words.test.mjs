import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { ago, fixed, percent, pixels } from '../../static/lib/format.js';
import { chordOf } from '../../static/lib/keys.js';
import { rangeOf, valueOf, withField, wordsOf } from '../../static/state/query.js';

describe('fixed', () => {
	it('writes a missing number as a dash', () => {
		assert.deepEqual([fixed(null, 2), fixed(undefined, 1), fixed(NaN, 0)], ['–', '–', '–']);
	});

	it('writes a true minus, and none before a zero', () => {
		assert.deepEqual([fixed(-6.4, 2, ' m'), fixed(-0.001, 2)], ['−6.40 m', '0.00']);
	});
});

describe('pixels', () => {
	it('drops the digit that nobody reads', () => {
		assert.equal(pixels(319_000), '>20k');
		assert.deepEqual([7.25, 210.6, 1656, 12940].map(pixels), ['7.3', '211', '1.7k', '13k']);
	});
});

describe('percent', () => {
	it('keeps to four characters', () => {
		assert.deepEqual([0.0586, 14.34, 112.8].map(percent), ['0.06', '14.3', '113']);
	});
});

describe('ago', () => {
	it('counts in the unit that fits', () => {
		const at = (seconds) => ago(0, seconds * 1000);
		assert.deepEqual([at(0), at(12), at(200), at(7300)], ['just now', '12 s ago', '3 min ago', '2 h ago']);
	});
});

describe('query words', () => {
	const q = 'status:unreviewed jac>0.5 jac<0.9 match:"a b" sort:value';

	it('keep quoted parts whole', () => {
		assert.deepEqual(wordsOf(q).at(-2), 'match:"a b"');
	});

	it('replace every word of a field', () => {
		assert.equal(withField(q, 'jac', ['jac<0.2']), 'status:unreviewed match:"a b" sort:value jac<0.2');
	});

	it('tell the value and the range of a field', () => {
		assert.equal(valueOf(q, 'sort'), 'value');
		assert.deepEqual(rangeOf(q, 'jac'), { low: 0.5, high: 0.9 });
		assert.deepEqual(rangeOf(q, 'sigma'), { low: null, high: null });
	});
});

describe('chordOf', () => {
	const press = (key, code, held = {}) => chordOf({
		key, code, ctrlKey: false, metaKey: false, altKey: false, shiftKey: false, ...held,
	});

	it('does not depend on capitals', () => {
		assert.equal(press('A', 'KeyA'), 'a');
	});

	it('names the digit that Shift turned into a sign', () => {
		assert.equal(press('!', 'Digit1', { shiftKey: true }), 'Shift+1');
	});

	it('takes signs as they are typed', () => {
		assert.equal(press('?', 'Minus', { shiftKey: true }), '?');
		assert.equal(press('/', 'Digit7', { shiftKey: false }), '/');
	});

	it('treats Command as Ctrl', () => {
		assert.equal(press('Z', 'KeyZ', { metaKey: true, shiftKey: true }), 'Ctrl+Shift+z');
	});
});
