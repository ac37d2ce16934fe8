// @ts-check
/** What the 3D view shows, as values in the pitch frame: metres, z down. */

import { cameraFromJson, pixelToIdeal, rayThrough } from '../../geometry/camera.js';
import { ellipsoidOf } from '../../geometry/ellipsoid.js';
import { apply, dot, subtract, transpose } from '../../geometry/matrix.js';
import { ballCenter, ballOf } from '../../geometry/preview.js';

/** @import {GroupDocument, SolutionJson, ViewJson} from '../../api/types.js' */
/** @import {Camera, ImagePoint, PitchPoint} from '../../geometry/camera.js' */
/** @import {Ellipsoid} from '../../geometry/ellipsoid.js' */

/**
 * @typedef {object} Stand a camera where it stands
 * @property {string} key of its view
 * @property {string} letter
 * @property {string} label
 * @property {Camera} camera
 * @property {{width: number, height: number}} size of its image
 * @property {string | null} image address of its frame
 * @property {PitchPoint[]} corners of its image, at the end of the frustum; clockwise from top left
 * @property {PitchPoint | null} ray where the ray of its ball ends
 * @property {boolean} used whether it helped to place the ball
 */
/** @typedef {{letters: string, point: PitchPoint, valid: boolean}} PairPoint */
/**
 * @typedef {object} PlacedBall
 * @property {PitchPoint} point
 * @property {number} height metres above the grass
 * @property {number | null} sigma metres
 * @property {Ellipsoid | null} ellipsoid at two standard deviations
 */
/**
 * @typedef {object} SceneValues
 * @property {{length: number, width: number}} pitch
 * @property {Stand[]} stands
 * @property {PairPoint[]} pairs
 * @property {PlacedBall | null} ball mean of the valid pairs
 * @property {PlacedBall | null} best the estimate from all views at once
 * @property {number} diameter of a ball, metres
 * @property {ReadonlySet<string>} [seen] letters of the cameras that see the ball of a track; else rays say so
 * @property {PitchPoint[]} [trail] where the ball of a track came from, two points for each piece
 */

/** How long a frustum is drawn, metres. */
const FRUSTUM = 9;
/** How far a ray is drawn when it meets nothing, metres. */
const RAY = 150;
/** Standard deviations of the ellipsoid. */
const DEVIATIONS = 2;

/** @param {GroupDocument} group @param {SolutionJson | null} solution @returns {SceneValues} */
export function sceneOf(group, solution) {
	const best = solution?.best_ball ?? null;
	const ball = solution?.mean_ball ?? solution?.ball ?? null;
	return {
		pitch: group.pitch,
		stands: solution ? standsOf(group, solution) : [],
		pairs: (solution?.pairs ?? []).map(({ a, b, point, valid }) => (
			{ letters: lettersOf(group, [a, b]), point, valid }
		)),
		ball: ball && placed(ball),
		best: best && placed(best),
		diameter: group.policy.ball_diameter_m,
	};
}

/** @param {GroupDocument} group @param {string[]} keys */
function lettersOf(group, keys) {
	return keys.map((key) => group.views.find((view) => view.key === key)?.letter ?? '?').join('–');
}

/**
 * @param {{point: PitchPoint, height_m: number, sigma_m: number | null, covariance: (number | null)[]}} ball
 * @returns {PlacedBall}
 */
function placed({ point, height_m, sigma_m, covariance }) {
	const sigma = sigma_m !== null && Number.isFinite(sigma_m) ? sigma_m : null;
	return { point, height: height_m, sigma, ellipsoid: ellipsoidOf(covariance, DEVIATIONS) };
}

/** @param {GroupDocument} group @param {SolutionJson} solution @returns {Stand[]} */
function standsOf(group, solution) {
	return group.views.flatMap((view) => {
		const solved = solution.views.find((one) => one.view === view.key);
		const json = solved?.calibration.camera;
		if (!solved || !json) return [];
		const camera = cameraFromJson(json);
		const ray = rayOf(view, camera, solution.ball?.point ?? null);
		return [{
			key: view.key, letter: view.letter, label: view.label, camera, size: view, image: view.image,
			corners: cornersOf(camera, view), ray, used: solved.included,
		}];
	});
}

/**
 * Where the ray of a view's ball ends: closest to the 3D ball, else on the grass.
 *
 * @param {ViewJson} view @param {Camera} camera @param {PitchPoint | null} ball
 * @returns {PitchPoint | null}
 */
function rayOf(view, camera, ball) {
	const seen = ballOf(view);
	const center = seen && ballCenter(seen);
	const ray = center && rayThrough(camera, center);
	if (!ray) return null;
	const reach = RAY / Math.hypot(...ray);
	const grass = ray[2] > 0 ? -camera.C[2] / ray[2] : Infinity;
	const nearest = ball ? dot(subtract(ball, camera.C), ray) / dot(ray, ray) : -1;
	return along(camera, ray, nearest > 0 ? nearest : Math.min(grass, reach));
}

/** @param {Camera} camera @param {PitchPoint} ray @param {number} t @returns {PitchPoint} */
function along({ C }, ray, t) {
	return [C[0] + t * ray[0], C[1] + t * ray[1], C[2] + t * ray[2]];
}

/** @param {Camera} camera @param {{width: number, height: number}} size @returns {PitchPoint[]} */
function cornersOf(camera, { width, height }) {
	const [right, bottom] = [width - 0.5, height - 0.5];
	const pixels = [{ x: -0.5, y: -0.5 }, { x: right, y: -0.5 }, { x: right, y: bottom }, { x: -0.5, y: bottom }];
	return pixels.map((pixel) => seenAt(camera, pixel, FRUSTUM));
}

/**
 * The point of the pitch frame that a pixel shows at a depth; through a wide lens, at that distance.
 *
 * @param {Camera} camera @param {ImagePoint} pixel @param {number} depth metres along the axis
 * @returns {PitchPoint}
 */
export function seenAt(camera, pixel, depth) {
	if (camera.wide) return seenAtDistance(camera, pixel, depth);
	// Where distortion has no inverse the pinhole is near enough for a picture's edge.
	const [x, y] = pixelToIdeal(camera, pixel) ?? pixelToIdeal({ ...camera, distorted: false }, pixel) ?? [0, 0];
	const [dx, dy, dz] = apply(transpose(camera.R), [x, y, 1]);
	return along(camera, [dx, dy, dz], depth);
}

/**
 * What a wide lens shows at a pixel, at a distance: a plane in front of it would reach to the horizon.
 *
 * @param {Camera} camera @param {ImagePoint} pixel @param {number} distance metres
 * @returns {PitchPoint} beyond the edge of what the lens shows, the nearest place that it does show
 */
function seenAtDistance(camera, pixel, distance) {
	const [x, y] = camera.principal;
	let ray = rayThrough(camera, pixel);
	for (let share = 1; !ray; share -= 0.01) {
		ray = rayThrough(camera, { x: x + share * (pixel.x - x), y: y + share * (pixel.y - y) });
	}
	return along(camera, ray, distance / Math.hypot(...ray));
}
