// @ts-check
/** The ball as a sphere: its consistent box, its outline. */

import {
	calibrationMatrix, idealToPixel, pitchToCamera, pixelToIdeal, rayThrough,
} from './camera.js';
import { bendJacobian } from './fisheye.js';
import { cross, dot, norm, subtract, times } from './matrix.js';

/** @import {Camera, ImagePoint, PitchPoint} from './camera.js' */
/** @typedef {[number, number, number, number]} Box   x, y, width, height, pixels */

/** @param {Box} box @returns {ImagePoint} */
export function boxCenter([x, y, width, height]) {
	return { x: x + width / 2, y: y + height / 2 };
}

/** @param {Box} box @returns {number} the d of a ball's box, pixels */
export function boxDiameter([, , width, height]) {
	return (width + height) / 2;
}

/** @param {ImagePoint} center @param {number} diameter @returns {Box} */
export function squareBox(center, diameter) {
	return [center.x - diameter / 2, center.y - diameter / 2, diameter, diameter];
}

/**
 * The diameter at which the ball of this centre comes closest to a point (closed form).
 *
 * @param {Camera} camera @param {ImagePoint} center @param {PitchPoint} point
 * @param {number} phi metres
 * @returns {{diameter: number, distance: number} | null} pixels; metres from the ray. null when
 *   the point lies behind the camera.
 */
export function optimizedBall(camera, center, point, phi) {
	const ray = rayThrough(camera, center);
	const ideal = pixelToIdeal(camera, center);
	if (!ray || !ideal) return null;
	const offset = subtract(point, camera.C);
	const depth = dot(ray, offset) / dot(ray, ray);
	if (depth <= 0) return null;
	const distance = norm(subtract(offset, times(ray, depth)));
	if (camera.wide) return { diameter: (phi * apparentScale(camera, ideal)) / (depth * norm(ray)), distance };
	// With skew, "vertical in the image" leans in normalised coordinates.
	const lean = -camera.skew / camera.focal[0];
	const half = phi / depth / 2 / Math.hypot(lean, 1);
	const upper = idealToPixel(camera, [ideal[0] - half * lean, ideal[1] - half]);
	const lower = idealToPixel(camera, [ideal[0] + half * lean, ideal[1] + half]);
	if (!upper || !lower) return null;
	const diameter = Math.hypot(lower.x - upper.x, lower.y - upper.y);
	return { diameter, distance };
}

/**
 * Mean of width and height of a small sphere's image through a wide lens, pixels for each radian that it fills.
 *
 * @param {Camera} camera @param {[number, number]} ideal normalised coordinates of the centre
 * @returns {number}
 */
function apparentScale(camera, [x, y]) {
	if (!camera.wide) return NaN;
	const [uu, uv, vu, vv] = bendJacobian([x, y], camera.wide);
	// Derivative of the ideal coordinates by a point at distance 1; its null space is the ray.
	const reach = Math.hypot(x, y, 1);
	const [ax, ay] = camera.focal;
	const [first, second] = [[ax * uu + camera.skew * vu, ax * uv + camera.skew * vv], [ay * vu, ay * vv]];
	/** @param {number[]} row */
	const length = ([p, q]) => Math.hypot(p, q, p * x + q * y) * reach;
	return (length(first) + length(second)) / 2;
}

/**
 * The outline of the ball in the image: a closed polygon.
 *
 * @param {Camera} camera @param {PitchPoint} point centre of the ball @param {number} phi metres
 * @param {number} count corners
 * @returns {ImagePoint[]} empty when the camera is inside the ball or the ball behind it
 */
export function ballOutline(camera, point, phi, count = 48) {
	const center = pitchToCamera(camera, point);
	const distance = norm(center);
	const ratio = phi / 2 / distance;
	if (ratio >= 1 || center[2] <= phi / 2) return [];
	// Rays touch the sphere along a circle that faces the camera.
	const middle = times(center, 1 - ratio * ratio);
	const radius = (phi / 2) * Math.sqrt(1 - ratio * ratio);
	const axis = times(center, 1 / distance);
	const across = cross(axis, [0, 1, 0]);
	const u = times(across, 1 / norm(across));
	const v = cross(axis, u);
	const outline = [];
	for (let i = 0; i < count; i++) {
		const angle = (2 * Math.PI * i) / count;
		const [c, s] = [radius * Math.cos(angle), radius * Math.sin(angle)];
		const [x, y, z] = middle.map((value, k) => value + c * u[k] + s * v[k]);
		const pixel = idealToPixel(camera, [x / z, y / z]);
		if (pixel) outline.push(pixel);
	}
	return outline;
}

/**
 * Tight bounds of the ball's image: closed form from the dual conic of the sphere, or from the
 * outline where the lens distorts.
 *
 * @param {Camera} camera @param {PitchPoint} point @param {number} phi metres
 * @returns {Box | null} null when the sphere is not wholly in front of the camera
 */
export function exactBox(camera, point, phi) {
	const center = pitchToCamera(camera, point);
	if (center[2] <= phi / 2) return null;
	if (camera.distorted) {
		const outline = ballOutline(camera, point, phi, 64);
		// What a wide lens shows in part has no box; other lenses keep the part that is seen.
		return camera.wide && outline.length < 64 ? null : boundsOf(outline);
	}
	const K = calibrationMatrix(camera);
	const [left, right] = bounds(K[0], center, (phi * phi) / 4);
	const [top, bottom] = bounds(K[1], center, (phi * phi) / 4);
	return [left, top, right - left, bottom - top];
}

/**
 * Where lines of one direction touch the outline: the roots of the dual conic
 * `K (c c' - r^2 I) K'` on that row of K.
 *
 * Source: Hartley & Zisserman, result 8.6.
 *
 * @param {number[]} row of K @param {number[]} center camera frame @param {number} r2
 * @returns {[number, number]}
 */
function bounds(row, center, r2) {
	const d00 = dot(row, center) ** 2 - r2 * dot(row, row);
	const d02 = dot(row, center) * center[2] - r2 * row[2];
	const d22 = center[2] * center[2] - r2;
	const root = Math.sqrt(d02 * d02 - d00 * d22);
	return [(d02 - root) / d22, (d02 + root) / d22];
}

/** @param {ImagePoint[]} points @returns {Box | null} */
function boundsOf(points) {
	if (points.length === 0) return null;
	const xs = points.map((point) => point.x);
	const ys = points.map((point) => point.y);
	const [left, top] = [Math.min(...xs), Math.min(...ys)];
	return [left, top, Math.max(...xs) - left, Math.max(...ys) - top];
}
