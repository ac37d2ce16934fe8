import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { idsBetween, indexOf, PAGE, pagesOf, rowAt, withPage } from '../../static/state/queue_pages.js';

/** A page whose rows have their place as id. */
const page = (number) => Array.from({ length: PAGE }, (_, place) => ({ id: number * PAGE + place }));
const pages = new Map([[0, page(0)], [3, page(3)]]);

describe('rowAt', () => {
	it('finds the row of a place, and nothing where nobody has looked', () => {
		assert.equal(rowAt(pages, 7).id, 7);
		assert.equal(rowAt(pages, 3 * PAGE + 99).id, 3 * PAGE + 99);
		assert.equal(rowAt(pages, PAGE), null);
		assert.equal(rowAt(new Map([[0, page(0).slice(0, 5)]]), 5), null);
	});
});

describe('indexOf', () => {
	it('is where a group stands, or -1', () => {
		assert.equal(indexOf(pages, 3 * PAGE + 2), 3 * PAGE + 2);
		assert.equal(indexOf(pages, 2 * PAGE), -1);
	});
});

describe('pagesOf', () => {
	it('has the pages that rows lie in, none outside the list', () => {
		assert.deepEqual(pagesOf(0, 20), [0]);
		assert.deepEqual(pagesOf(-20, PAGE, 12_764), [0, 1]);
		assert.deepEqual(pagesOf(12_700, 12_900, 12_764), [127]);
		assert.deepEqual(pagesOf(0, 20, 0), []);
	});
});

describe('withPage', () => {
	it('adds a page, or puts a newer one in its place', () => {
		const newer = page(3).reverse();
		assert.equal(withPage(pages, 3, newer).get(3), newer);
		assert.deepEqual([...withPage(pages, 1, page(1)).keys()].sort(), [0, 1, 3]);
	});

	it('forgets the farthest of very many', () => {
		let kept = new Map();
		for (let number = 0; number < 60; number++) kept = withPage(kept, number, page(number));
		assert.equal(kept.size, 40);
		assert.deepEqual([kept.has(59), kept.has(20), kept.has(19)], [true, true, false]);
	});
});

describe('idsBetween', () => {
	it('has the ids of rows that are there, else says that it cannot', () => {
		assert.deepEqual(idsBetween(pages, 98, 99), [98, 99]);
		assert.equal(idsBetween(pages, 98, 100), null);
	});
});
