// @ts-check
/** Where the ray of one view's ball runs in another view. */

import { project, rayThrough } from './camera.js';

/** @import {Camera, ImagePoint, PitchPoint} from './camera.js' */

const LOWEST = 0;
const HIGHEST = 30;
const FARTHEST = 300;
const STEPS = 96;

/**
 * The ray through a pixel of camera a, between the grass and 30 m above it, as camera b sees it.
 *
 * @param {Camera} a @param {ImagePoint} pixel @param {Camera} b @param {number} [highest] metres above the grass
 * @returns {ImagePoint[]} a polyline, empty when b sees nothing of it
 */
export function epipolarSegment(a, pixel, b, highest = HIGHEST) {
	const ray = rayThrough(a, pixel);
	if (!ray) return [];
	const range = heightRange(a.C, ray, highest);
	if (!range) return [];
	const points = [];
	for (let i = 0; i <= STEPS; i++) {
		// Equal ratios: the other camera may stand anywhere beside the ray, and see any stretch of it.
		const t = range[0] * (range[1] / range[0]) ** (i / STEPS);
		const pixelB = project(b, [a.C[0] + t * ray[0], a.C[1] + t * ray[1], a.C[2] + t * ray[2]]);
		if (pixelB) points.push(pixelB);
	}
	return points;
}

/**
 * Where along `origin + t ray` the height is between 0 and so many metres.
 *
 * @param {PitchPoint} origin @param {PitchPoint} ray @param {number} [highest]
 * @returns {[number, number] | null}
 */
export function heightRange(origin, ray, highest = HIGHEST) {
	let near = 0.5;
	let far = FARTHEST;
	const height = -origin[2];
	const climb = -ray[2];
	if (Math.abs(climb) < 1e-9) return height >= LOWEST && height <= highest ? [near, far] : null;
	const first = (LOWEST - height) / climb;
	const second = (highest - height) / climb;
	near = Math.max(near, Math.min(first, second));
	far = Math.min(far, Math.max(first, second));
	return near < far ? [near, far] : null;
}
