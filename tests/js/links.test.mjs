import assert from 'node:assert/strict';
import { test } from 'node:test';

import { instantBeside, mapText, markOf, replayFrameAt, speedText, whyApart, withInstant } from '../../static/state/links.js';

const INSTANTS = [{ live: 5, replay: 30 }, { live: 15, replay: 50 }];
const FRAMES = { first: 4, replay: [null, 20, 22], off_s: [null, 0, 0], repeated: [21], blended: [22] };
const MAP = /** @type {const} */ ({ outcome: 'linked', found_by: 'instants', reason: null, speed: 0.25, speed_sigma: 0.004, sigma_s: 0.02, miss_m: null, pieces: [], misses: [], ball_reason: null, turned: false, too_close: false });

test('a speed is told as times slower or faster', () => {
	assert.deepEqual([0.25, 1, 0.99, 2].map(speedText), ['4.0 times slower than live', 'at live speed', 'at live speed', '2.0 times faster than live']);
});

test('a map says its speed and how well its times are known', () => {
	const [text] = mapText(MAP, 50);
	assert.match(text, /4\.0 times slower than live \(speed 0\.250 ± 0\.0040\)\. Found from your instants\. .* ± 1\.0 live frames/);
	const piece = { first: 3, last: 9, first_s: 0, last_s: 1, offset_s: 0, speed: 0.5, speed_sigma: 0.1 };
	const pieces = mapText({ ...MAP, speed: null, pieces: [piece, { ...piece, first: 9, last: 20, speed: 1 }] }, 50);
	assert.equal(pieces.length, 3);
	assert.match(pieces[2], /Frames 9 to 20 of the replay run at live speed/);
	assert.deepEqual(mapText({ ...MAP, ball_reason: 'The ball rests.' }, 50).slice(1), ['The times could not be found from the ball. The ball rests.']);
	const close = mapText({ ...MAP, outcome: 'offset', reason: 'Too close together; 1 is assumed.', speed: 1, too_close: true }, 50);
	assert.deepEqual(close, ['Too close together; 1 is assumed.']);
	assert.match(mapText({ ...MAP, outcome: 'offset', reason: 'One; 1 is assumed.', speed: 1 }, 50)[0], /^One linked instant fixes/);
	assert.deepEqual(mapText({ ...MAP, outcome: 'unobservable', reason: 'The ball rests.' }, 50), ['The ball rests.']);
});

test('a live frame has a frame of the replay, or none', () => {
	assert.deepEqual([3, 4, 5, 6, 7].map((live) => replayFrameAt(FRAMES, live)), [null, null, 20, 22, null]);
	assert.deepEqual([20, 21, 22].map((frame) => markOf(FRAMES, frame)), ['', 'repeats the frame before', 'a mix of two frames']);
	assert.equal(markOf(null, 21), '');
});

test('a frame of the replay is linked once', () => {
	assert.deepEqual(withInstant(INSTANTS, { live: 6, replay: 30 }), [{ live: 6, replay: 30 }, INSTANTS[1]]);
	assert.deepEqual(withInstant(INSTANTS, { live: 9, replay: 40 }).map(({ replay }) => replay), [30, 40, 50]);
});

test('the instant before and behind a frame is the nearest one', () => {
	assert.equal(instantBeside(INSTANTS, 'live', 5, 1), INSTANTS[1]);
	assert.equal(instantBeside(INSTANTS, 'replay', 60, -1), INSTANTS[1]);
	assert.equal(instantBeside(INSTANTS, 'live', 5, -1), undefined);
});

test('a replay that cannot follow says why', () => {
	assert.equal(whyApart({ map: MAP, instants: INSTANTS }), '');
	assert.equal(whyApart({ map: { ...MAP, outcome: 'offset', reason: 'One; 1 is assumed.' }, instants: INSTANTS.slice(1) }), 'Link two instants first.');
	assert.equal(whyApart({ map: { ...MAP, outcome: 'unobservable', reason: 'They run backwards.' }, instants: INSTANTS }), 'They run backwards.');
});

test('a replay that runs much faster than live is unlikely', () => {
	assert.match(mapText({ ...MAP, speed: 5 }, 50).at(-1) ?? '', /is unlikely/);
	assert.doesNotMatch(mapText({ ...MAP, speed: 1.02 }, 50).join(), /unlikely/);
});
