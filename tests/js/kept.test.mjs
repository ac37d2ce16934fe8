import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { Kept } from '../../static/lib/kept.js';

describe('Kept', () => {
	it('keeps what was put into it last', () => {
		const kept = new Kept(2);
		kept.set('a', 1).set('b', 2).set('c', 3);
		assert.deepEqual([...kept], [['b', 2], ['c', 3]]);
	});

	it('takes what is put in once more for the newest', () => {
		const kept = new Kept(2);
		kept.set('a', 1).set('b', 2).set('a', 4).set('c', 3);
		assert.deepEqual([...kept], [['a', 4], ['c', 3]]);
	});
});
