/** Shots of a recording as values. */

import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { changedAt, clockOf, clockSeconds, clockText, everyOf, lengthText, matchTime, mergedWithNext, shotAt, splitAt, timecode } from '../../static/state/shots.js';

const shot = (first, last, more = {}) => ({ first, last, kind: 'main', entered_by: 'cut', kept: null, ...more });
const SHOTS = [shot(0, 9, { entered_by: 'start' }), shot(14, 39, { kind: 'replay', entered_by: 'wipe', kept: true }), shot(40, 59)];

describe('shotAt', () => {
	it('finds the shot of a frame, within a transition the next one', () => {
		assert.deepEqual([0, 9, 10, 13, 14, 40, 59, 70].map((frame) => shotAt(SHOTS, frame)), [0, 0, 1, 1, 1, 2, 2, 2]);
		assert.equal(shotAt([], 3), -1);
	});
});

describe('splitAt', () => {
	it('makes two shots that are alike, the second behind a cut', () => {
		const [, before, after] = splitAt(SHOTS, 20);
		assert.deepEqual(before, shot(14, 19, { kind: 'replay', entered_by: 'wipe', kept: true }));
		assert.deepEqual(after, shot(20, 39, { kind: 'replay', kept: true }));
	});
	it('splits nothing at the first frame of a shot, or between shots', () => {
		assert.deepEqual([0, 14, 11, 60].map((frame) => splitAt(SHOTS, frame)), [null, null, null, null]);
	});
});

describe('mergedWithNext', () => {
	it('joins two shots with what lies between them', () => {
		assert.deepEqual(mergedWithNext(SHOTS, 0), [shot(0, 39, { entered_by: 'start' }), SHOTS[2]]);
		assert.equal(mergedWithNext(SHOTS, 2), null);
		assert.equal(mergedWithNext(SHOTS, -1), null);
	});
});

describe('changedAt', () => {
	it('changes one shot and leaves the list as it was', () => {
		assert.equal(changedAt(SHOTS, 1, { kept: false })[1].kept, false);
		assert.equal(SHOTS[1].kept, true);
		assert.equal(changedAt(SHOTS, 3, { kept: false }), null);
	});
});

describe('everyOf', () => {
	it('begins with the first frame and stays within the shot', () => {
		assert.deepEqual(everyOf(SHOTS[1], 10), [14, 24, 34]);
		assert.deepEqual(everyOf(SHOTS[0], 25), [0]);
		assert.equal(everyOf(SHOTS[0], 0).length, 10);
	});
});

describe('timecode', () => {
	it('counts frames within their second', () => {
		assert.equal(timecode(0, 25), '00:00.00');
		assert.equal(timecode(727.12, 25), '12:07.03');
		assert.equal(timecode(3600 + 59.98, 50), '1:00:59.49');
		assert.equal(timecode(2002 / 1000, 24000 / 1001), '00:02.00');
	});
});

describe('lengthText', () => {
	it('says seconds, and minutes of what is longer', () => {
		assert.deepEqual([0.6, 12.34, 59.9, 59.96, 119.7, 3599].map(lengthText), ['0.6 s', '12.3 s', '59.9 s', '1:00', '2:00', '59:59']);
	});
});

describe('clockOf', () => {
	it('says when a frame is shown by the times of its shot, which ends when its last frame is over', () => {
		const timed = [{ ...SHOTS[0], start_s: 0, end_s: 0.4 }, { ...SHOTS[1], start_s: 0.56, end_s: 5.76 }, { ...SHOTS[2], start_s: 5.76, end_s: 6.56 }];
		const seconds = clockOf(timed, 25);
		assert.deepEqual([0, 9, 12, 14, 39, 40, 59].map((frame) => seconds(frame).toFixed(2)), ['0.00', '0.36', '0.16', '0.56', '5.56', '5.76', '6.52']);
		assert.equal(clockOf([{ ...shot(3, 3), start_s: 2, end_s: 2.04 }], 25)(3), 2);
		assert.equal(clockOf(SHOTS, 25)(50), 2);
	});
});

describe('matchTime', () => {
	it('goes on from the last frame whose clock was read', () => {
		assert.deepEqual(['12:40', ' 97:05 ', '12:60', '1240', '-1:00'].map(clockSeconds), [760, 5825, null, null, null]);
		assert.deepEqual([clockText(1, 760), clockText(2, 2700.9), clockText(1, -3)], ['1st half 12:40', '2nd half 45:00', '1st half −00:03']);
		const clocks = [{ frame: 10, half: 1, seconds: 760 }, { frame: 40, half: 2, seconds: 2700 }];
		const seconds = (/** @type {number} */ frame) => frame / 10;
		assert.deepEqual([0, 10, 39, 40, 55].map((frame) => matchTime(clocks, seconds, frame)), ['1st half 12:39', '1st half 12:40', '1st half 12:42', '2nd half 45:00', '2nd half 45:01']);
		assert.equal(matchTime([], seconds, 3), '');
	});
});
