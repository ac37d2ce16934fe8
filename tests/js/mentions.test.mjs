import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { completed, nameBefore, partsOf } from '../../static/state/mentions.js';

describe('nameBefore', () => {
	it('is the name that ends at the caret', () => {
		assert.equal(nameBefore('look @An', 8), 'an');
		assert.equal(nameBefore('@', 1), '');
	});
	it('is none in an address, and after a space', () => {
		assert.equal(nameBefore('mail x@an', 9), null);
		assert.equal(nameBefore('@anna ', 6), null);
	});
});

describe('completed', () => {
	it('takes the place of what was begun, and leaves what follows', () => {
		assert.deepEqual(completed('see @an please', 7, 'anna'), { value: 'see @anna please', caret: 10 });
	});
});

describe('partsOf', () => {
	it('tells mentions of known people from all else', () => {
		assert.deepEqual(partsOf('@Anna, @nobody', ['anna']), [{ text: '@Anna', mention: true }, { text: ', @nobody', mention: false }]);
	});
});
