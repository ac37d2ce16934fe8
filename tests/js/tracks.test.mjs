/** Tracks of the ball as values. */

import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { contradictedAfter, corrected, curvesOf, eventAt, eventBy, forgetTrackChange, lastTrackChange, mostShown, partOf, rememberTrack, runsOf, undoOfTrack } from '../../static/state/tracks.js';

const EVENTS = [{ frame: 10, kind: 'kick' }, { frame: 14, kind: 'bounce' }, { frame: 30, kind: 'out' }];
const FRAMES = {
	frame: [4, 5, 6], x: [1, 2, null], y: [0, 0, null], z: [-0.5, -1, null],
	covariance: [[0.04, 0, 0, 0.01, 0, 0.09], [0.04, 0, 0, 0.01, 0, 0.09], null], raw: [[1.1, 0, -0.4], null, null], events: EVENTS,
};

describe('runsOf', () => {
	it('joins neighbours of one value', () => {
		assert.deepEqual(runsOf(['a', 'a', 'b', 'a']), [{ value: 'a', from: 0, to: 1 }, { value: 'b', from: 2, to: 2 }, { value: 'a', from: 3, to: 3 }]);
		assert.deepEqual(runsOf([]), []);
	});
});

describe('contradictedAfter', () => {
	it('leads from frame to frame with a ball that contradicts the track, and round', () => {
		const found = [{ frame: 5 }, { frame: 5 }, { frame: 9 }];
		assert.deepEqual([4, 5, 9].map((at) => contradictedAfter(found, at)), [5, 9, 5]);
		assert.equal(contradictedAfter([], 4), undefined);
	});
});

describe('curvesOf', () => {
	it('turns heights upwards, with a band of two sigma and no value in gaps', () => {
		const { values, low, high, raw } = curvesOf(FRAMES, 2);
		assert.deepEqual([values, raw], [[0.5, 1, null], [0.4, null, null]]);
		assert.deepEqual([low, high].map((edge) => edge.map((value) => value && Number(value.toFixed(6)))), [[-0.1, 0.4, null], [1.1, 1.6, null]]);
		assert.deepEqual(curvesOf(FRAMES, 0).values, [1, 2, null]);
	});
});

describe('partOf', () => {
	it('cuts columns and keeps events', () => {
		const part = partOf({ ...FRAMES, events: EVENTS.slice(0, 2) }, 1, 2);
		assert.deepEqual([part.frame, part.x, part.events.length], [[5, 6], [2, null], 2]);
		assert.equal(partOf(FRAMES, 0, 9), FRAMES);
	});
});

describe('mostShown', () => {
	it('is not that of the few largest errors', () => {
		assert.equal(mostShown([...Array(20).fill(8), 2000, null]), 16);
		assert.equal(mostShown([null]), 10);
	});
});

describe('events', () => {
	it('are found from a frame on, and near it', () => {
		assert.equal(eventBy(EVENTS, 10, 1)?.frame, 14);
		assert.equal(eventBy(EVENTS, 10, -1), undefined);
		assert.equal(eventAt(EVENTS, 12.5)?.frame, 14);
		assert.equal(eventAt(EVENTS, 20), undefined);
	});
});

describe('corrected', () => {
	const added = { frame: 20, kind: 'kick', added: true };
	const removed = { frame: 21, kind: 'kick', added: false };
	it('adds, and what is removed again leaves nothing', () => {
		assert.deepEqual(corrected([], added), [added]);
		assert.deepEqual(corrected([added], removed), []);
		assert.deepEqual(corrected([], removed), [removed]);
	});
	it('replaces what was said of the same event', () => {
		assert.deepEqual(corrected([removed], added), [added]);
		assert.deepEqual(corrected([added], { ...removed, frame: 40 }), [added, { ...removed, frame: 40 }]);
	});
});

describe('undo of a track', () => {
	const bounce = { frame: 148, kind: 'bounce', added: false };
	const track = (/** @type {any} */ said) => /** @type {any} */ ({ id: 1, dataset: 'a', verdict: null, note: null, corrections: [], ...said });
	it('sends what the track said before, and nothing else', () => {
		const [plain, removed] = [track({}), track({ corrections: [bounce] })];
		rememberTrack(plain, removed);
		const change = lastTrackChange('a');
		assert.deepEqual(undoOfTrack(change, removed), { corrections: [] });
		forgetTrackChange(change);
		assert.equal(lastTrackChange('a'), undefined);
		const rejected = track({ verdict: 'rejected', note: 'too short' });
		assert.deepEqual(undoOfTrack({ track: 1, dataset: 'a', before: plain, after: rejected }, rejected), { verdict: 'none' });
		assert.deepEqual(undoOfTrack({ track: 1, dataset: 'a', before: rejected, after: plain }, plain), { verdict: 'rejected', note: 'too short' });
	});
	it('leaves what somebody else said since', () => {
		const [plain, accepted] = [track({}), track({ verdict: 'accepted' })];
		const change = { track: 1, dataset: 'a', before: plain, after: accepted };
		assert.equal(undoOfTrack(change, track({ verdict: 'rejected' })), null);
		assert.equal(undoOfTrack(change, track({ verdict: 'accepted', corrections: [bounce] })), null);
	});
	it('stays in its dataset', () => {
		rememberTrack(track({ id: 2, dataset: 'b' }), track({ id: 2, dataset: 'b', verdict: 'accepted' }));
		assert.equal(lastTrackChange('a'), undefined);
		assert.equal(lastTrackChange('b')?.track, 2);
	});
});
