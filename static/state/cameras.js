// @ts-check
/** Cameras over time as values: where a stretch is worst or lost, and how its markings look in a frame. */

import { cameraFromJson, project } from '../geometry/camera.js';
import { pitchMarkings } from '../geometry/pitch.js';

/** @import {FrameCamerasJson} from '../api/cameras.js' */
/** @import {PitchPoint} from '../geometry/camera.js' */

/** @typedef {{outcome: string, first: number, last: number}} Run frames in a row with one outcome */

/** @type {{[letter: string]: {name: string, meaning: string}}} */
export const OUTCOMES = {
	T: { name: 'tracked', meaning: 'the camera was fitted to the painted lines' },
	B: { name: 'bridged', meaning: 'the camera was computed from the background' },
	L: { name: 'lost', meaning: 'no camera' },
};

/** Metres between places at which a marking is projected. */
const STEP = 1;
/** Beyond the frame by this share of it, a marking is not drawn. */
const BEYOND = 0.5;

/** Frames in a row that have one outcome. @param {FrameCamerasJson} cameras @returns {Run[]} */
export function runsOf({ outcome, first }) {
	/** @type {Run[]} */
	const runs = [];
	[...outcome].forEach((letter, place) => {
		const run = runs.at(-1);
		if (run?.outcome === letter) run.last = first + place;
		else runs.push({ outcome: letter, first: first + place, last: first + place });
	});
	return runs;
}

/** The first frame of the next stretch that is not tracked, from the beginning again behind the last one; null: all are. @param {FrameCamerasJson} cameras @param {number} frame */
export function nextUntracked(cameras, frame) {
	const runs = runsOf(cameras).filter(({ outcome }) => outcome !== 'T');
	return (runs.find(({ first }) => first > frame) ?? runs[0])?.first ?? null;
}

/** The tracked frame whose paint lies farthest from its markings; null: none is. @param {FrameCamerasJson} cameras */
export function worstFrame({ error_px: errors, first }) {
	let worst = -1;
	errors.forEach((error, place) => { if (error !== null && error > (errors[worst] ?? -1)) worst = place; });
	return worst < 0 ? null : first + worst;
}

/** Every marking in places a metre apart. @param {number} length @param {number} width metres */
const markingsOf = (length, width) => [...pitchMarkings(length, width).values()].map((line) => line.flatMap((end, index) => {
	if (index === 0) return [end];
	const start = line[index - 1];
	const steps = Math.max(1, Math.ceil(Math.hypot(...end.map((value, axis) => value - start[axis])) / STEP));
	return Array.from({ length: steps }, (_, step) => /** @type {PitchPoint} */ (end.map((value, axis) => start[axis] + ((value - start[axis]) * (step + 1)) / steps)));
}));

/** @type {WeakMap<FrameCamerasJson, PitchPoint[][]>} */
const drawn = new WeakMap();

/** Those of the pitch of its match. @param {FrameCamerasJson} cameras */
function markingsIn(cameras) {
	const known = drawn.get(cameras) ?? markingsOf(cameras.pitch[0], cameras.pitch[1]);
	drawn.set(cameras, known);
	return known;
}

/** The camera of a frame; null where it has none. @param {FrameCamerasJson} cameras @param {number} frame */
export function cameraAt({ first, camera, principal_point: principal }, frame) {
	const row = camera[frame - first];
	if (!row || !principal) return null;
	const [x, y, z, pan, tilt, roll, across, down, k1] = row;
	return cameraFromJson(/** @type {import('../api/types.js').CameraJson} */ ({
		pan_degrees: pan, tilt_degrees: tilt, roll_degrees: roll, x_focal_length: across, y_focal_length: down,
		principal_point: principal, position_meters: [x, y, z], radial_distortion: [k1, 0, 0, 0, 0, 0],
	}));
}

/** The markings of a frame as data of an SVG path, pixels of the frame; empty where it has no camera. @param {FrameCamerasJson} cameras @param {number} frame */
export function markingsPath(cameras, frame) {
	const camera = cameraAt(cameras, frame);
	if (!camera) return '';
	const [width, height] = cameras.size;
	const parts = [];
	for (const line of markingsIn(cameras)) {
		let pen = false;
		for (const place of line) {
			const pixel = project(camera, place);
			const seen = pixel && Math.abs(pixel.x / width - 0.5) < 0.5 + BEYOND && Math.abs(pixel.y / height - 0.5) < 0.5 + BEYOND;
			if (pixel && seen) parts.push(`${pen ? 'L' : 'M'}${pixel.x.toFixed(1)} ${pixel.y.toFixed(1)}`);
			pen = Boolean(seen);
		}
	}
	return parts.join('');
}
