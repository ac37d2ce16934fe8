/** Cameras over time as values. */

import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { cameraAt, markingsPath, nextUntracked, runsOf, worstFrame } from '../../static/state/cameras.js';

const ROW = [0, 60, -15, 0, 75, 0, 1500, 1500, 0];
const cameras = (outcome, more = {}) => ({
	first: 10, last: 9 + outcome.length, size: [1280, 720], principal_point: [639.5, 359.5], pitch: [105, 68], outcome,
	camera: [...outcome].map((letter) => (letter === 'L' ? null : ROW)),
	error_px: [...outcome].map((letter, place) => (letter === 'T' ? place / 10 : null)), ...more,
});

describe('runsOf', () => {
	it('joins frames of one outcome', () => {
		assert.deepEqual(runsOf(cameras('TTBLLT')), [
			{ outcome: 'T', first: 10, last: 11 }, { outcome: 'B', first: 12, last: 12 },
			{ outcome: 'L', first: 13, last: 14 }, { outcome: 'T', first: 15, last: 15 },
		]);
	});
});

describe('nextUntracked', () => {
	it('leads from one stretch to the next, and round', () => {
		const some = cameras('TBBTLT');
		assert.deepEqual([0, 10, 11, 13, 14].map((frame) => nextUntracked(some, frame)), [11, 11, 14, 14, 11]);
		assert.equal(nextUntracked(cameras('TTT'), 10), null);
	});
});

describe('worstFrame', () => {
	it('is the tracked one with the largest error', () => {
		assert.equal(worstFrame(cameras('TTTB')), 12);
		assert.equal(worstFrame(cameras('LB')), null);
	});
});

describe('markingsPath', () => {
	it('draws what lies in the picture and around it, and nothing without a camera', () => {
		const some = cameras('TL');
		const places = [...markingsPath(some, 10).matchAll(/[ML](-?[\d.]+) (-?[\d.]+)/g)].map(([, x, y]) => [Number(x), Number(y)]);
		assert.ok(places.length > 100);
		assert.ok(places.every(([x, y]) => x > -641 && x < 1921 && y > -361 && y < 1081));
		// The camera looks at the centre mark's column: the middle line is upright in the middle of the picture.
		const middle = places.filter(([x]) => Math.abs(x - 639.5) < 0.06);
		assert.ok(middle.length > 20);
		assert.equal(markingsPath(some, 11), '');
		assert.equal(markingsPath(some, 9), '');
	});
	it('has the numbers of the server for its camera', () => {
		const { C, focal, principal } = cameraAt(cameras('T'), 10);
		assert.deepEqual([C, focal, principal], [[0, 60, -15], [1500, 1500], [639.5, 359.5]]);
	});
});
