// @ts-check
/** How far off is far: the same words, colours and dashes at every resolution. */

import { nearestOn } from './polyline.js';

/** @import {LinesJson, MarkingFitJson} from '../api/types.js' */
/** @import {ImagePoint} from './camera.js' */

/** @typedef {'ok' | 'warn' | 'bad' | 'unseen'} Grade */
/** @typedef {{point: ImagePoint, nearest: ImagePoint | null, distance: number | null}} Residual */
/**
 * @typedef {object} MarkingResiduals
 * @property {string} marking
 * @property {Grade} grade
 * @property {number | null} largest pixels
 * @property {Residual[]} points one for each annotated point
 * @property {ImagePoint[]} polyline where the camera puts the marking; may be empty
 * @property {boolean} used false when the solver left the marking out
 */

/** Dash patterns in CSS pixels: a misfit differs in shape, not only in hue. */
export const DASHES = /** @type {Record<Grade, number[]>} */ ({
	ok: [], warn: [14, 6], bad: [5, 5], unseen: [1, 5],
});

/**
 * The grade of a marking by its largest residual: JaC counts it as wrong from gamma on, and half
 * of that is worth a look.
 *
 * @param {number | null} largest pixels; null when nobody annotated it
 * @param {number} gamma pixels
 * @returns {Grade}
 */
export function gradeOfResidual(largest, gamma) {
	if (largest === null) return 'unseen';
	if (largest >= gamma) return 'bad';
	return largest >= gamma / 2 ? 'warn' : 'ok';
}

/**
 * The grade of a number that may be as large as a limit, and no larger.
 *
 * @param {number | null | undefined} value @param {number} limit
 * @returns {Grade}
 */
export function gradeBelow(value, limit) {
	if (value === null || value === undefined) return 'unseen';
	if (value > limit) return 'bad';
	return value >= limit / 2 ? 'warn' : 'ok';
}

/** @param {number | null | undefined} jac @param {number} least @returns {Grade} */
export function gradeOfJac(jac, least) {
	if (jac === null || jac === undefined) return 'unseen';
	if (jac <= least) return 'bad';
	return jac <= least + 0.1 ? 'warn' : 'ok';
}

/**
 * Largest ratio of a ball's box that says nothing: people draw boxes around the ball, a quarter too
 * large on average (SoccerNet-v3D's are 19 % off) and up to 1.45 in the sample.
 */
const ORDINARY_SIZE = 1.5;
/** Beyond it the solver has a finding, `ball_size`. */
const ODD_SIZE = 2;

/** Annotated over expected diameter of the ball. @param {number | null | undefined} ratio @returns {Grade} */
export function gradeOfSize(ratio) {
	if (ratio === null || ratio === undefined) return 'unseen';
	const off = Math.abs(Math.log(ratio));
	if (off > Math.log(ODD_SIZE)) return 'bad';
	return off > Math.log(ORDINARY_SIZE) ? 'warn' : 'ok';
}

export const GLYPHS = /** @type {Record<Grade, string>} */ ({
	ok: '✓', warn: '!', bad: '✗', unseen: '○',
});

/**
 * Every marking of a view that is annotated or visible, the worst first.
 *
 * A marking whose points and fit are the same values as last time comes back as the same value,
 * so that what draws it has nothing to do.
 *
 * @param {LinesJson} lines as shown, edits included
 * @param {MarkingFitJson[]} fits of the camera in use
 * @param {number} gamma pixels
 * @param {boolean} live whether the points may differ from those that were fitted
 * @returns {MarkingResiduals[]}
 */
export function residualsOf(lines, fits, gamma, live) {
	const names = new Set([...Object.keys(lines), ...fits.map((fit) => fit.marking)]);
	const all = [...names].map((marking) => {
		const fit = fits.find((candidate) => candidate.marking === marking);
		const points = lines[marking] ?? NO_POINTS;
		const key = points === NO_POINTS ? (fit ?? NO_POINTS) : points;
		const known = cache.get(key);
		if (known && known.fit === fit && known.live === live && known.gamma === gamma) return known.result;
		const result = markingResiduals(marking, points, fit, gamma, live);
		cache.set(key, { fit, live, gamma, result });
		return result;
	});
	return all.sort((a, b) => (b.largest ?? -1) - (a.largest ?? -1));
}

/** @type {ImagePoint[]} */
const NO_POINTS = [];
/** @type {WeakMap<object, {fit: MarkingFitJson | undefined, live: boolean, gamma: number, result: MarkingResiduals}>} */
const cache = new WeakMap();

/**
 * @param {string} marking @param {ImagePoint[]} points @param {MarkingFitJson | undefined} fit
 * @param {number} gamma @param {boolean} live
 * @returns {MarkingResiduals}
 */
function markingResiduals(marking, points, fit, gamma, live) {
	const polyline = (fit?.polyline ?? []).map(([x, y]) => ({ x, y }));
	const told = fit && !live && fit.distances_px.length === points.length;
	const residuals = points.map((point, i) => {
		const on = nearestOn(polyline, point);
		const distance = told ? fit.distances_px[i] : (on?.distance ?? null);
		return { point, nearest: on?.point ?? null, distance };
	});
	const distances = residuals.flatMap(({ distance }) => (distance === null ? [] : [distance]));
	const largest = distances.length ? Math.max(...distances) : null;
	// Annotated where the camera sees nothing of it is as wrong as far off.
	const lost = points.length > 0 && largest === null && fit?.outcome === 'fn';
	const grade = lost ? 'bad' : gradeOfResidual(largest, gamma);
	return { marking, grade, largest, points: residuals, polyline, used: fit?.used ?? true };
}
