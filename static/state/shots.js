// @ts-check
/** Shots of a recording as values: what splits, joins and names them. Frames are numbers from 0. */

/** @import {MatchClock, Shot, ShotKind, TimedShot} from '../api/recordings.js' */

/** @type {{kind: ShotKind, letter: string, label: string}[]} */
export const SHOT_KINDS = [
	{ kind: 'main', letter: 'M', label: 'main camera' },
	{ kind: 'replay', letter: 'R', label: 'replay' },
	{ kind: 'closeup', letter: 'C', label: 'close-up' },
	{ kind: 'other', letter: 'O', label: 'other' },
];

/** @param {ShotKind} kind */
export function kindOf(kind) {
	return SHOT_KINDS.find((one) => one.kind === kind) ?? SHOT_KINDS[3];
}

/** The shot that shows a frame; within a transition the one that comes next, else the last. @template {Shot} T @param {T[]} shots @param {number} frame */
export function shotAt(shots, frame) {
	const found = shots.findIndex(({ last }) => frame <= last);
	return found < 0 ? shots.length - 1 : found;
}

/** Two shots where there was one, the second from a frame on; null: nothing can be split there. @param {Shot[]} shots @param {number} frame @returns {Shot[] | null} */
export function splitAt(shots, frame) {
	const index = shots.findIndex(({ first, last }) => first < frame && frame <= last);
	if (index < 0) return null;
	const shot = shots[index];
	return shots.toSpliced(index, 1, { ...shot, last: frame - 1 }, { ...shot, first: frame, entered_by: 'cut' });
}

/** A shot and the next one as one, which is as the first; null: there is no next one. @param {Shot[]} shots @param {number} index @returns {Shot[] | null} */
export function mergedWithNext(shots, index) {
	const [shot, next] = [shots[index], shots[index + 1]];
	if (!shot || !next) return null;
	return shots.toSpliced(index, 2, { ...shot, last: next.last });
}

/** With one of them changed. @param {Shot[]} shots @param {number} index @param {Partial<Shot>} change @returns {Shot[] | null} */
export function changedAt(shots, index, change) {
	const shot = shots[index];
	return shot ? shots.with(index, { ...shot, ...change }) : null;
}

/** Every so many frames of a shot, beginning with its first. @param {Shot} shot @param {number} step @returns {number[]} */
export function everyOf({ first, last }, step) {
	const by = Math.max(1, Math.round(step));
	return Array.from({ length: Math.floor((last - first) / by) + 1 }, (_, index) => first + index * by);
}

/** When a frame is shown, by the times of the shots around it: seconds from a frame. @param {Shot[]} shots @param {number} fps where no shot has times @returns {(frame: number) => number} */
export function clockOf(shots, fps) {
	const timed = /** @type {TimedShot[]} */ (shots.filter((shot) => 'start_s' in shot));
	return (frame) => {
		const shot = timed[shotAt(timed, frame)];
		if (!shot) return frame / fps;
		const step = (shot.end_s - shot.start_s) / (shot.last - shot.first + 1);
		return Math.max(0, shot.start_s + (frame - shot.first) * step);
	};
}

/** Minutes, seconds and the frame within its second: 12:07.03. @param {number} seconds @param {number} fps */
export function timecode(seconds, fps) {
	// A frame of a rate that is no fraction of a second begins a little before or after its place.
	const whole = Math.floor(seconds + 1e-6);
	const frame = Math.min(Math.round((seconds - whole) * fps), Math.ceil(fps) - 1);
	/** @param {number} value */
	const two = (value) => String(value).padStart(2, '0');
	const hours = Math.floor(whole / 3600);
	const minutes = Math.floor(whole / 60) % 60;
	return `${hours ? `${hours}:` : ''}${two(minutes)}:${two(whole % 60)}.${two(Math.max(0, frame))}`;
}

/** How long a shot is: 3.4 s, 1:12. @param {number} seconds */
export function lengthText(seconds) {
	if (seconds < 59.95) return `${seconds.toFixed(1)} s`;
	return `${Math.floor(Math.round(seconds) / 60)}:${String(Math.round(seconds) % 60).padStart(2, '0')}`;
}

export const HALVES = ['1st half', '2nd half', 'extra time 1', 'extra time 2'];

/** Seconds of what a clock shows: 12:40; null: it is none. @param {string} text */
export function clockSeconds(text) {
	const found = /^(\d{1,3}):([0-5]\d)$/.exec(text.trim());
	return found ? 60 * Number(found[1]) + Number(found[2]) : null;
}

/** Time of the match in words: 1st half 12:40. @param {number} half from 1 @param {number} seconds */
export function clockText(half, seconds) {
	const whole = Math.floor(Math.abs(seconds) + 1e-6);
	const sign = seconds < -1e-6 && whole ? '−' : '';
	return `${HALVES[half - 1]} ${sign}${String(Math.floor(whole / 60)).padStart(2, '0')}:${String(whole % 60).padStart(2, '0')}`;
}

/** Time of the match in a frame, in words, or "" where nobody has read the clock. @param {MatchClock[]} clocks by frame @param {(frame: number) => number} secondsOf @param {number} frame */
export function matchTime(clocks, secondsOf, frame) {
	const clock = clocks.findLast((one) => one.frame <= frame) ?? clocks[0];
	return clock ? clockText(clock.half, clock.seconds + secondsOf(frame) - secondsOf(clock.frame)) : '';
}
