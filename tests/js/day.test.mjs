/** Days as people mean them. */

import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { beginningOf, isOverHere } from '../../static/lib/day.js';

/** @param {string} zone @param {() => void} check */
function where(zone, check) {
	const before = process.env.TZ;
	process.env.TZ = zone;
	try {
		check();
	} finally {
		if (before === undefined) delete process.env.TZ;
		else process.env.TZ = before;
	}
}

describe('the beginning of a day', () => {
	it('is midnight where the person is', () => {
		where('Asia/Tokyo', () => assert.equal(beginningOf('2026-11-28'), '2026-11-27T15:00:00.000Z'));
		where('America/New_York', () => assert.equal(beginningOf('2026-11-28'), '2026-11-28T05:00:00.000Z'));
		where('UTC', () => assert.equal(beginningOf('2026-11-28'), '2026-11-28T00:00:00.000Z'));
	});

	it('comes after as many hours as the day before has', () => {
		where('Europe/Berlin', () => {
			assert.equal(beginningOf('2026-03-29'), '2026-03-28T23:00:00.000Z');
			assert.equal(beginningOf('2026-03-29', 1), '2026-03-29T22:00:00.000Z');
			assert.equal(beginningOf('2026-12-31', 1), '2026-12-31T23:00:00.000Z');
		});
	});

	it('of what is no day is left to whoever is asked', () => {
		for (const odd of ['foo', '', '2026-11-28T10:00', '28.11.2026']) assert.equal(beginningOf(odd), odd);
	});
});

describe('a day', () => {
	it('is over at the midnight of whoever looks at it', () => {
		const [late, early] = ['2026-11-28T14:59:59Z', '2026-11-28T15:00:00Z'].map((at) => Date.parse(at));
		where('Asia/Tokyo', () => assert.deepEqual([late, early].map((at) => isOverHere('2026-11-28', at)), [false, true]));
		where('America/New_York', () => {
			assert.equal(isOverHere('2026-11-28', Date.parse('2026-11-29T04:59:59Z')), false);
			assert.equal(isOverHere('2026-11-28', Date.parse('2026-11-29T05:00:00Z')), true);
		});
	});
});
