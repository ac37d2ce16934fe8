// @ts-check
/**
 * Camera: the pinhole with lens distortion that maps the pitch into an image.
 *
 * Pitch frame: metres, origin at the centre mark, z down. Camera frame: x right, y down,
 * z forward, `X_cam = R (X - C)`. Image frame: pixels of the annotated size.
 */

import { distort, foldRadius, undistort } from './distortion.js';
import { bend, profileOf, unbend } from './fisheye.js';
import { apply, multiply, subtract, transpose } from './matrix.js';

/** @import {CameraJson} from '../api/types.js' */
/** @import {Profile} from './fisheye.js' */

/** @typedef {{x: number, y: number}} ImagePoint   image pixels */
/** @typedef {[number, number, number]} PitchPoint   metres, z down */
/**
 * @typedef {object} Camera
 * @property {number[][]} R world to camera, 3 x 3
 * @property {PitchPoint} C position, metres
 * @property {[number, number]} focal alpha_x, alpha_y, pixels
 * @property {[number, number]} principal x0, y0, pixels
 * @property {number} skew pixels
 * @property {number[]} distortion OpenCV's 12 coefficients
 * @property {boolean} distorted whether the lens distorts at all
 * @property {Profile | null} [wide] of a lens for strong wide angle, in place of the coefficients
 * @property {number} fold ideal radius beyond which nothing is visible
 */

/** Metres in front of the camera below which nothing is visible. */
export const MIN_DEPTH = 1e-3;

/**
 * World-to-camera rotation `(Rz(pan) Rx(tilt) Rz(roll))^T`; radians.
 *
 * Pan 0 looks towards -y, tilt 90 degrees is horizontal, less looks down.
 *
 * @param {number} pan @param {number} tilt @param {number} roll
 * @returns {number[][]}
 */
export function rotationFromPanTiltRoll(pan, tilt, roll) {
	return transpose(multiply(multiply(aboutZ(pan), aboutX(tilt)), aboutZ(roll)));
}

/** @param {number} angle */
function aboutZ(angle) {
	const [c, s] = [Math.cos(angle), Math.sin(angle)];
	return [[c, -s, 0], [s, c, 0], [0, 0, 1]];
}

/** @param {number} angle */
function aboutX(angle) {
	const [c, s] = [Math.cos(angle), Math.sin(angle)];
	return [[1, 0, 0], [0, c, -s], [0, s, c]];
}

/**
 * The camera of a SoccerNet camera JSON; its angles are authoritative.
 *
 * @param {CameraJson} json
 * @returns {Camera}
 */
export function cameraFromJson(json) {
	const degrees = Math.PI / 180;
	const [k1 = 0, k2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0] = json.radial_distortion ?? [];
	const [p1 = 0, p2 = 0] = json.tangential_distortion ?? [];
	const [s1 = 0, s2 = 0, s3 = 0, s4 = 0] = json.thin_prism_distortion ?? [];
	const wide = profileOf(json.lens, json.lens_coefficients);
	const distortion = [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4];
	return {
		R: rotationFromPanTiltRoll(
			json.pan_degrees * degrees, json.tilt_degrees * degrees, json.roll_degrees * degrees,
		),
		C: json.position_meters,
		focal: [json.x_focal_length, json.y_focal_length],
		principal: json.principal_point,
		skew: json.skew ?? 0,
		distortion,
		distorted: wide !== null || distortion.some((value) => value !== 0),
		wide,
		fold: wide ? Math.tan(wide.widest) : foldRadius(distortion),
	};
}

/**
 * Projection matrix `K R [I | -C]` without distortion, 3 x 4.
 *
 * @param {Camera} camera
 * @returns {number[][]}
 */
export function projectionMatrix(camera) {
	const KR = multiply(calibrationMatrix(camera), camera.R);
	const last = apply(KR, camera.C);
	return KR.map((row, i) => [...row, -last[i]]);
}

/** @param {Camera} camera @returns {number[][]} K, 3 x 3 */
export function calibrationMatrix(camera) {
	const [ax, ay] = camera.focal;
	const [x0, y0] = camera.principal;
	return [[ax, camera.skew, x0], [0, ay, y0], [0, 0, 1]];
}

/**
 * A point of the pitch in the camera frame, metres.
 *
 * @param {Camera} camera @param {PitchPoint} point
 * @returns {number[]}
 */
export function pitchToCamera(camera, point) {
	return apply(camera.R, subtract(point, camera.C));
}

/**
 * Pixel of a point, as the distorted image shows it.
 *
 * @param {Camera} camera @param {PitchPoint} point
 * @returns {ImagePoint | null} null behind the camera or beyond the fold
 */
export function project(camera, point) {
	const [x, y, z] = pitchToCamera(camera, point);
	if (z <= MIN_DEPTH) return null;
	return idealToPixel(camera, [x / z, y / z]);
}

/**
 * Pixel of ideal normalised coordinates.
 *
 * @param {Camera} camera @param {[number, number]} ideal
 * @returns {ImagePoint | null} null beyond the fold
 */
export function idealToPixel(camera, ideal) {
	if (!camera.distorted) return unitToPixel(camera, ideal);
	if (camera.wide) {
		const bent = bend(ideal, camera.wide);
		return bent && unitToPixel(camera, bent);
	}
	if (Math.hypot(ideal[0], ideal[1]) > camera.fold) return null;
	return unitToPixel(camera, distort(ideal, camera.distortion));
}

/** @param {Camera} camera @param {[number, number]} unit @returns {ImagePoint} */
function unitToPixel(camera, [x, y]) {
	return {
		x: camera.focal[0] * x + camera.skew * y + camera.principal[0],
		y: camera.focal[1] * y + camera.principal[1],
	};
}

/**
 * Ideal normalised coordinates of a pixel: K^-1 and undistortion.
 *
 * @param {Camera} camera @param {ImagePoint} pixel
 * @returns {[number, number] | null} null where distortion has no inverse
 */
export function pixelToIdeal(camera, pixel) {
	const y = (pixel.y - camera.principal[1]) / camera.focal[1];
	const x = (pixel.x - camera.principal[0] - camera.skew * y) / camera.focal[0];
	if (!camera.distorted) return [x, y];
	return camera.wide ? unbend([x, y], camera.wide) : undistort([x, y], camera.distortion);
}

/**
 * Pixel of the ideal pinhole for a pixel of the image.
 *
 * @param {Camera} camera @param {ImagePoint} pixel
 * @returns {ImagePoint | null}
 */
export function undistortPixel(camera, pixel) {
	if (!camera.distorted) return pixel;
	const ideal = pixelToIdeal(camera, pixel);
	return ideal && unitToPixel(camera, ideal);
}

/**
 * Direction of the ray through a pixel, pitch frame; not of unit length (camera z is 1).
 *
 * @param {Camera} camera @param {ImagePoint} pixel
 * @returns {PitchPoint | null}
 */
export function rayThrough(camera, pixel) {
	const ideal = pixelToIdeal(camera, pixel);
	if (!ideal) return null;
	const [x, y, z] = apply(transpose(camera.R), [ideal[0], ideal[1], 1]);
	return [x, y, z];
}
