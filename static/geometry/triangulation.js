// @ts-check
/** A point from two views, by the linear DLT on pixels, as the server does it. */

import { MIN_DEPTH, pitchToCamera, project, projectionMatrix, undistortPixel } from './camera.js';
import { apply, cross, dot, norm, smallestSingularVector, subtract, times } from './matrix.js';

/** @import {Camera, ImagePoint, PitchPoint} from './camera.js' */

/** Fourth coordinate of a unit vector below which it is no place but a direction. */
const PARALLEL = 1e-12;

/**
 * The point whose images are the two pixels: homogeneous linear DLT on pixel coordinates.
 *
 * Source: Hartley & Zisserman, sec. 12.2. P is not normalised, because the
 * released datasets follow from this estimator and from no other.
 *
 * @param {Camera} a @param {ImagePoint} pixelA as the image of a shows it
 * @param {Camera} b @param {ImagePoint} pixelB
 * @returns {PitchPoint | null} null for a pixel without a ray or a point at infinity
 */
export function triangulate(a, pixelA, b, pixelB) {
	const idealA = undistortPixel(a, pixelA);
	const idealB = undistortPixel(b, pixelB);
	if (!idealA || !idealB) return null;
	const X = smallestSingularVector([
		...rows(projectionMatrix(a), idealA),
		...rows(projectionMatrix(b), idealB),
	]);
	if (Math.abs(X[3]) < PARALLEL) return null;
	return [X[0] / X[3], X[1] / X[3], X[2] / X[3]];
}

/** @param {number[][]} P @param {ImagePoint} pixel */
function rows(P, pixel) {
	return [subtract(times(P[2], pixel.x), P[0]), subtract(times(P[2], pixel.y), P[1])];
}

/**
 * Distance in pixels between a pixel and the image of a point.
 *
 * A point behind the camera has no image; it is measured by the pinhole's formula, so that the
 * number stays finite. Ask `isInFront` as well.
 *
 * @param {Camera} camera @param {PitchPoint} point @param {ImagePoint} pixel
 * @returns {number}
 */
export function reprojectionError(camera, point, pixel) {
	const { x, y } = project(camera, point) ?? pinhole(camera, point);
	return Math.hypot(x - pixel.x, y - pixel.y);
}

/** @param {Camera} camera @param {PitchPoint} point @returns {ImagePoint} */
function pinhole(camera, point) {
	const [x, y, w] = apply(projectionMatrix(camera), [...point, 1]);
	return { x: x / w, y: y / w };
}

/** @param {Camera} camera @param {PitchPoint} point */
export function isInFront(camera, point) {
	return pitchToCamera(camera, point)[2] > MIN_DEPTH;
}

/**
 * Angle between the rays of two cameras that meet at a point, degrees.
 *
 * @param {Camera} a @param {Camera} b @param {PitchPoint} point
 * @returns {number}
 */
export function parallaxDegrees(a, b, point) {
	const first = subtract(point, a.C);
	const second = subtract(point, b.C);
	// atan2 keeps its digits near zero, where arccos loses half of them.
	return (Math.atan2(norm(cross(first, second)), dot(first, second)) * 180) / Math.PI;
}

/** @param {Camera} a @param {Camera} b @returns {number} metres between the two cameras */
export function baseline(a, b) {
	return norm(subtract(a.C, b.C));
}
