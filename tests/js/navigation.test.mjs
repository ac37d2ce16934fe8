/** The query that makes the queue, and what it leads to. */

import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

globalThis.location = /** @type {any} */ ({ pathname: '/groups', search: '' });
globalThis.history = /** @type {any} */ ({
	pushState(/** @type {any} */ _state, /** @type {string} */ _title, /** @type {string} */ url) {
		const { pathname, search } = new URL(url, 'http://here');
		Object.assign(location, { pathname, search });
	},
});

const { groupDocument } = await import('../../static/state/group.js');
const { lastGroup, lastGroupAddress, query } = await import('../../static/state/navigation.js');
const { navigate } = await import('../../static/lib/router.js');

/** @param {string} url @returns {string} */
function queryAt(url) {
	navigate(url);
	return query.value;
}

describe('the query', () => {
	it('is what the address of a queue, or of a group in it, asks for', () => {
		for (const page of ['/groups', '/review/7', '/review/7/calibration', '/review/7/history', '/datasets/a/statistics']) {
			assert.equal(queryAt(`${page}?q=is:solved`), 'is:solved', page);
		}
		assert.equal(queryAt('/review?batch=3'), 'batch:3');
	});

	it('is none of a page that has words and batches of its own', () => {
		for (const url of ['/tracks/3?batch=7', '/datasets/a/tracks?batch=7', '/datasets/a/agreement?batch=7', '/audit?q=login', '/work?q=x']) assert.equal(queryAt(url), '', url);
	});
});

describe('the way back to the last group', () => {
	beforeEach(() => { groupDocument.value = null; });

	it('keeps the query of its own dataset, and no other', () => {
		lastGroup.value = 7;
		groupDocument.value = /** @type {any} */ ({ id: 7, dataset: { name: 'a' } });
		navigate('/datasets/b/statistics?q=match:b');
		assert.equal(lastGroupAddress('b'), '/review/7');
		navigate('/datasets/a/statistics?q=match:a');
		assert.equal(lastGroupAddress('a'), '/review/7?q=match%3Aa');
	});

	it('is the first of the queue where none was on screen', () => {
		lastGroup.value = 0;
		assert.equal(lastGroupAddress('a'), '/review');
	});
});
