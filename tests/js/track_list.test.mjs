/** Lists of tracks. */

import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { choiceOf, listValues, nextIn, trackAddress } from '../../static/state/track_list.js';

describe('a list of tracks', () => {
	it('is what its address says', () => {
		const values = listValues(new URLSearchParams('show=open&mine=1&batch=7&sort=worst&frame=12'));
		assert.deepEqual(choiceOf(values, 'ann'), { verdict: 'none', assigned: 'ann', batch: 7, sort: 'worst' });
		assert.equal(trackAddress(3, values), '/tracks/3?show=open&mine=1&batch=7&sort=worst');
		assert.deepEqual(choiceOf(listValues(new URLSearchParams()), 'ann'), { sort: undefined });
	});
	it('goes on behind a track, and begins again at its end', () => {
		const items = [{ id: 4 }, { id: 2 }, { id: 9 }];
		assert.deepEqual([4, 2, 9, 5].map((id) => nextIn(items, id)?.id), [2, 9, 4, 4]);
		assert.equal(nextIn([{ id: 4 }], 4), null);
	});
});
