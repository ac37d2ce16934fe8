// @ts-check
/** Ball runs as values: where the ball is in a frame, and which frames a person has to look at. */

import { pitchToCamera, rayThrough } from '../geometry/camera.js';

/** @import {BallRunFrames} from '../api/ball_runs.js' */
/** @import {Camera, ImagePoint, PitchPoint} from '../geometry/camera.js' */

/** @typedef {'followed' | 'uncertain' | 'confirmed' | 'lost'} BallState */
/** @typedef {{x: number, y: number, diameter: number, sigma: number, confidence: number, state: BallState}} BallPlace */
/** @typedef {{state: BallState, first: number, last: number}} BallPart frames in a row with one state */

const BALL_M = 0.22;
/** Beyond it nobody plays, metres. */
const FARTHEST_M = 150;

/** The state of a row. @param {BallRunFrames} run @param {number} row @returns {BallState} */
function stateOf(run, row) {
	if (run.state[row] === 'F') return 'followed';
	return run.confirmed.includes(run.frame[row]) ? 'confirmed' : 'uncertain';
}

/** Where a run has the ball in a frame; null: nowhere. @param {BallRunFrames} run @param {number} frame @returns {BallPlace | null} */
export function ballAt(run, frame) {
	const row = run.frame.indexOf(frame);
	if (row < 0) return null;
	return { x: run.x[row], y: run.y[row], diameter: run.diameter[row], sigma: run.sigma_px[row], confidence: run.confidence[row], state: stateOf(run, row) };
}

/** Frames in a row that have one state; those between that have no ball are lost. @param {BallRunFrames} run @returns {BallPart[]} */
export function partsOf(run) {
	/** @type {BallPart[]} */
	const parts = [];
	/** @param {number} frame @param {BallState} state */
	const add = (frame, state) => {
		const last = parts.at(-1);
		if (last?.state === state) last.last = frame;
		else parts.push({ state, first: frame, last: frame });
	};
	run.frame.forEach((frame, row) => {
		const before = row ? run.frame[row - 1] : frame - 1;
		for (let gone = before + 1; gone < frame; gone += 1) add(gone, 'lost');
		add(frame, stateOf(run, row));
	});
	return parts;
}

/** The first frame of the next stretch that a person has to look at, from the beginning again behind the last one; null: none. @param {BallRunFrames[]} runs @param {number} frame */
export function nextUncertain(runs, frame) {
	const open = runs.flatMap(partsOf).filter(({ state }) => state === 'uncertain' || state === 'lost').map(({ first }) => first).sort((a, b) => a - b);
	return open.find((first) => first > frame) ?? open[0] ?? null;
}

/** The uncertain frames in a row around a frame. @param {BallRunFrames} run @param {number} frame @returns {number[]} */
export function uncertainAround(run, frame) {
	const part = partsOf(run).find(({ state, first, last }) => state === 'uncertain' && first <= frame && frame <= last);
	return part ? Array.from({ length: part.last - part.first + 1 }, (_, at) => part.first + at) : [];
}

/** The run that is meant at a frame: the newest that has it, else one that ends beside it. @param {BallRunFrames[]} runs @param {number} frame */
export function runAt(runs, frame) {
	const newest = [...runs].sort((a, b) => b.id - a.id);
	return newest.find(({ first, last }) => first <= frame && frame <= last)
		?? newest.find(({ first, last }) => first - 1 <= frame && frame <= last + 1) ?? null;
}

/** Diameter of a ball that lies on the grass where a pixel looks; null: it looks at none. @param {Camera} camera @param {ImagePoint} pixel */
export function expectedDiameter(camera, pixel) {
	const ray = rayThrough(camera, pixel);
	if (!ray || ray[2] <= 1e-6) return null;
	const far = (-BALL_M / 2 - camera.C[2]) / ray[2];
	const place = /** @type {PitchPoint} */ (camera.C.map((value, axis) => value + far * ray[axis]));
	if (!(far > 0) || Math.hypot(place[0], place[1]) > FARTHEST_M) return null;
	const ahead = pitchToCamera(camera, place)[2];
	return ahead > 0 ? (BALL_M * camera.focal[0]) / ahead : null;
}
