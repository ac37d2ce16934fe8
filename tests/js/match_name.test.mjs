import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { matchName } from '../../static/lib/match_name.js';

describe('matchName', () => {
	const match = 'england_epl/2014-2015/2015-02-21 - 18-00 Crystal Palace 1 - 2 Arsenal';

	it('says who played, and beside it when and where', () => {
		assert.deepEqual(matchName(match), {
			name: 'Crystal Palace 1 – 2 Arsenal', aside: 'england epl 2014-2015 · 2015-02-21 18:00',
		});
	});

	it('keeps the picture of a group', () => {
		assert.equal(matchName(`${match}/12_1.png`).name, 'Crystal Palace 1 – 2 Arsenal, 12_1.png');
	});

	it('leaves every other key as it is', () => {
		assert.deepEqual(matchName('film/frame 104'), { name: 'film/frame 104', aside: '' });
	});
});
