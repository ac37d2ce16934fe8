import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { pathFromAbove, pitchMarkings } from '../../static/geometry/pitch.js';
import { twinMarking } from '../../static/state/edits.js';
import { close } from './scene.mjs';

describe('pitchMarkings', () => {
	const markings = pitchMarkings(105, 68);

	it('has the 26 markings', () => {
		assert.equal(markings.size, 26);
	});

	it('names the posts as seen from the pitch', () => {
		close(markings.get('Goal left post left')[0], [-52.5, 3.66, -2.44]);
		close(markings.get('Goal right post left')[0], [52.5, -3.66, -2.44]);
	});

	it('puts the penalty area where the Laws put it', () => {
		close(markings.get('Big rect. right main')[0], [36, -20.16, 0]);
	});

	it('turns by half a circle into its twins', () => {
		for (const [name, points] of markings) {
			const turned = points.map(([x, y, z]) => [-x, -y, z].map((v) => (v + 0).toFixed(6)).join()).sort();
			const twin = markings.get(twinMarking(name)).map((p) => p.map((v) => (v + 0).toFixed(6)).join()).sort();
			const plain = (rows) => rows.map((row) => row.replaceAll('-0.000000', '0.000000')).sort();
			assert.deepEqual(new Set(plain(turned)), new Set(plain(twin)), name);
		}
	});
});

describe('pathFromAbove', () => {
	it('leads along the points, whatever their height, to the centimetre', () => {
		assert.equal(pathFromAbove([[-52.5, 3.661, -2.44], [0, 10, 0]]), 'M-52.50 3.66L0.00 10.00');
	});
});
