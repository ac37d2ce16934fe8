import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { plainMarking } from '../../static/geometry/marking_words.js';
import { pitchMarkings } from '../../static/geometry/pitch.js';

describe('plainMarking', () => {
	it('says an arc, an area and a post as people do', () => {
		assert.equal(plainMarking('Circle right'), 'arc of the right penalty area');
		assert.equal(plainMarking('Small rect. left top'), 'left goal area, far side');
		assert.equal(plainMarking('Goal right post left'), 'right goal, left post');
		assert.equal(plainMarking('Goal left crossbar'), 'left goal, crossbar');
	});

	it('has other words for every marking of the pitch, each its own', () => {
		const names = [...pitchMarkings(105, 68).keys()];
		const plain = names.map(plainMarking);
		assert.equal(new Set(plain).size, names.length);
		assert.deepEqual(names.filter((name, i) => plain[i] === name), []);
	});

	it('leaves a name that it does not know', () => {
		assert.equal(plainMarking('Line unknown'), 'Line unknown');
	});
});
