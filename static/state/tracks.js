// @ts-check
/** What a track is drawn from: runs of modes, curves with their bands, and corrections of its events. */

/** @import {BallMode, BallState, Correction, EventKind, TrackEvent, TrackFrames, TrackJson, TrackJump} from '../api/tracks.js' */
/** @typedef {Pick<TrackJson, 'verdict' | 'note' | 'corrections'>} TrackReview what people say of a track */
/** @typedef {{track: number, dataset: string, before: TrackReview, after: TrackReview}} TrackChange */

/** Frames between an event and the frame that somebody means by it; as the server takes it. */
export const NEAR = 3;
/** Changes that can be undone. */
const KEPT = 100;

/** What a state is called, and the shade of its run. */
export const STATES = /** @type {Record<BallState, string>} */ ({
	measured: 'measured by two views or more', one_view: 'seen by one view', predicted: 'predicted', bridged: 'bridged over a gap', gap: 'not known',
});
/** What the ball does. */
export const MODES = /** @type {Record<BallMode, {name: string, letter: string}>} */ ({
	roll: { name: 'rolls', letter: 'R' }, flight: { name: 'flies', letter: 'F' }, held: { name: 'is held', letter: 'H' }, out: { name: 'is out of play', letter: 'O' }, '': { name: 'not known', letter: '' },
});
export const EVENTS = /** @type {{kind: EventKind, key: string, letter: string}[]} */ ([
	{ kind: 'kick', key: '1', letter: 'K' }, { kind: 'bounce', key: '2', letter: 'B' }, { kind: 'out', key: '3', letter: 'O' },
]);

/**
 * Frames that follow each other with one value.
 *
 * @template {string} T
 * @param {T[]} values
 * @returns {{value: T, from: number, to: number}[]} places in the list, both included
 */
export function runsOf(values) {
	/** @type {{value: T, from: number, to: number}[]} */
	const runs = [];
	values.forEach((value, place) => {
		const last = runs.at(-1);
		if (last?.value === value) last.to = place;
		else runs.push({ value, from: place, to: place });
	});
	return runs;
}

/** The next frame after one with a ball that contradicts the track; after the last, the first. @param {{frame: number}[]} contradicted @param {number} at */
export function contradictedAfter(contradicted, at) {
	return (contradicted.find(({ frame }) => frame > at) ?? contradicted[0])?.frame;
}

/** The standard deviation along x, y or upwards. @param {TrackFrames} frames @param {0 | 1 | 2} axis @returns {(number | null)[]} */
export function spread(frames, axis) {
	const place = [0, 3, 5][axis];
	return frames.covariance.map((one) => (one ? Math.sqrt(Math.max(one[place], 0)) : null));
}

/** The track along an axis with its band of two sigma, and what frames alone say; heights point up. @param {TrackFrames} frames @param {0 | 1 | 2} axis */
export function curvesOf(frames, axis) {
	const sign = axis === 2 ? -1 : 1;
	const values = [frames.x, frames.y, frames.z][axis].map((value) => (value === null ? null : sign * value));
	const sigma = spread(frames, axis);
	/** @param {number} by */
	const edge = (by) => values.map((value, place) => (value === null ? null : value + by * (sigma[place] ?? 0)));
	return { values, low: edge(-2), high: edge(2), raw: frames.raw.map((one) => (one ? sign * one[axis] : null)) };
}

/** Values of some frames where others are shown, null where they have none. @param {number[]} shown @param {{frame: number[]}} around @param {(number | null)[]} values one for each frame of `around` */
export function amid(shown, { frame }, values) {
	return shown.map((number) => values[number - frame[0]] ?? null);
}

/** The largest error that a curve shows: few are far larger than all others, and would flatten them. @param {(number | null)[]} values */
export function mostShown(values) {
	const known = values.filter((value) => value !== null).sort((one, other) => one - other);
	return Math.ceil(Math.max(10, 2 * (known.at(Math.floor(0.9 * known.length)) ?? 0)));
}

/** The part of a track between two places. @param {TrackFrames} frames @param {number} from @param {number} to @returns {TrackFrames} */
export function partOf(frames, from, to) {
	if (from <= 0 && to >= frames.frame.length - 1) return frames;
	const part = Object.fromEntries(Object.entries(frames).map(([name, list]) => [name, Array.isArray(list) && list.length === frames.frame.length ? list.slice(from, to + 1) : list]));
	return /** @type {TrackFrames} */ (part);
}

/** A jump where other views take over, in words. @param {TrackJump} jump */
export function jumpText({ frame, metres, views }) {
	return `jump of ${metres.toFixed(1)} m in frame ${frame}, where the views change to ${views.join(', ')}`;
}

/** The next event from a frame on, or the one before. @param {TrackEvent[]} events @param {number} frame @param {1 | -1} way @returns {TrackEvent | undefined} */
export function eventBy(events, frame, way) {
	return way > 0 ? events.find((one) => one.frame > frame) : events.findLast((one) => one.frame < frame);
}

/** The event at a frame, or near it. @param {TrackEvent[]} events @param {number} frame */
export function eventAt(events, frame) {
	const near = events.filter((one) => Math.abs(one.frame - frame) <= NEAR);
	return near.sort((one, other) => Math.abs(one.frame - frame) - Math.abs(other.frame - frame)).at(0);
}

/** Corrections with one more; what said the opposite of it near that frame goes. @param {Correction[]} corrections @param {Correction} one */
export function corrected(corrections, one) {
	const rest = corrections.filter((other) => other.kind !== one.kind || Math.abs(other.frame - one.frame) > NEAR);
	const undone = rest.length < corrections.length && corrections.some((other) => other.kind === one.kind && other.added !== one.added && Math.abs(other.frame - one.frame) <= NEAR);
	return undone && !one.added ? rest : [...rest, one];
}

/** What was said of tracks in this window, the last one last. @type {TrackChange[]} */
const trackChanges = [];

/** The last change of a track of a dataset. @param {string} dataset */
export function lastTrackChange(dataset) {
	return trackChanges.findLast((change) => change.dataset === dataset);
}

/** @param {TrackChange} change */
export function forgetTrackChange(change) {
	trackChanges.splice(trackChanges.indexOf(change), 1);
}

/** @param {TrackJson} before @param {TrackJson} after */
export function rememberTrack(before, after) {
	trackChanges.push({ track: after.id, dataset: after.dataset, before, after });
	if (trackChanges.length > KEPT) trackChanges.shift();
}

/**
 * What takes a change back.
 *
 * @param {TrackChange} change @param {TrackReview} present
 * @returns {{verdict?: 'accepted' | 'rejected' | 'none', note?: string, corrections?: Correction[]} | null} null: the track says something else by now
 */
export function undoOfTrack({ before, after }, { verdict, corrections }) {
	/** @param {Correction[]} list */
	const text = (list) => JSON.stringify(list.map(({ frame, kind, added }) => [frame, kind, added]));
	if (verdict !== after.verdict || text(corrections) !== text(after.corrections)) return null;
	return {
		...(before.verdict === verdict ? {} : { verdict: before.verdict ?? 'none' }),
		...(before.verdict !== verdict && before.note ? { note: before.note } : {}),
		...(text(before.corrections) === text(corrections) ? {} : { corrections: before.corrections }),
	};
}
