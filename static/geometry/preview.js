// @ts-check
/** What the ball's numbers would be, at once: the server's formulas on the cameras of a solution. */

import { boxCenter, boxDiameter, exactBox, optimizedBall, squareBox } from './ball.js';
import { cameraFromJson, project } from './camera.js';
import {
	baseline, isInFront, parallaxDegrees, reprojectionError, triangulate,
} from './triangulation.js';

/**
 * @import {
 *   BallFitJson, BallJson, GroupDocument, PairSolutionJson, PolicyJson, SolutionJson, ViewJson, ViewSolutionJson
 * } from '../api/types.js'
 * @import {Camera, ImagePoint, PitchPoint} from './camera.js'
 */

/** @typedef {{view: ViewJson, camera: Camera, center: ImagePoint, tau: number, dropped: string | null}} Seen */

const NO_BOX = { optimized_diameter_px: null, optimized_box: null, exact_box: null, size_ratio: null };

/**
 * The ball of a view: null when there is none, or several to pick from.
 *
 * @param {ViewJson} view
 * @returns {BallJson | null}
 */
export function ballOf(view) {
	const seen = view.balls.filter((ball) => !ball.out_of_view && (ball.box || ball.point));
	return seen.length === 1 ? seen[0] : null;
}

/** @param {BallJson} ball @returns {ImagePoint | null} */
export function ballCenter(ball) {
	if (ball.box) return boxCenter(ball.box);
	return ball.point ? { x: ball.point[0], y: ball.point[1] } : null;
}

/** @param {{width: number, height: number}} view @returns {number} pixels */
export function diagonal(view) {
	return Math.hypot(view.width, view.height);
}

/**
 * The solution with its pairs, ball and ball fits computed again from the group's balls.
 *
 * Calibrations, gates and findings stay: they are the server's. The ball is the mean of pairs whatever the policy exports.
 *
 * @param {GroupDocument} group
 * @param {SolutionJson} solution
 * @returns {SolutionJson}
 */
export function previewBall(group, solution) {
	const seen = seenBalls(group, solution);
	const pairs = pairsOf(seen, group.policy);
	const valid = pairs.filter((pair) => pair.valid);
	const point = mean(valid.map((pair) => pair.point));
	const included = new Set(valid.flatMap((pair) => [pair.a, pair.b]));
	return {
		...solution,
		pairs,
		point: 'mean',
		mean_ball: null,
		ball: point && {
			point,
			height_m: -point[2],
			sigma_m: solution.ball?.sigma_m ?? NaN,
			covariance: solution.ball?.covariance ?? [],
			parallax_degrees: largestParallax(seen, valid, point),
			views: group.views.map((view) => view.key).filter((key) => included.has(key)),
		},
		views: solution.views.map((view) => {
			const one = seen.find((candidate) => candidate.view.key === view.view);
			const fit = one && point ? fitBall(one, point, group.policy.ball_diameter_m) : null;
			// Outside every valid pair a view has its errors alone: no box stands for a ball that it does not confirm.
			const ball = fit && !included.has(view.view) ? { ...fit, ...NO_BOX } : fit;
			return { ...view, included: included.has(view.view), ball, expected: point ? expectBall(view, point, group.policy.ball_diameter_m) : null };
		}),
	};
}

/**
 * Where a view should show the ball; how far off that may be is the server's, of the last solution.
 *
 * @param {ViewSolutionJson} solved @param {PitchPoint} point @param {number} phi
 * @returns {ViewSolutionJson['expected']}
 */
function expectBall({ calibration, expected }, point, phi) {
	if (!calibration.camera) return null;
	const camera = cameraFromJson(calibration.camera);
	const image = project(camera, point);
	return image && { place: [image.x, image.y], covariance: expected?.covariance ?? [], box: exactBox(camera, point, phi) };
}

/** @param {GroupDocument} group @param {SolutionJson} solution @returns {Seen[]} */
export function seenBalls(group, solution) {
	return group.views.flatMap((view) => {
		const solved = solution.views.find((candidate) => candidate.view === view.key);
		const ball = ballOf(view);
		const center = ball && ballCenter(ball);
		const json = solved?.calibration.camera;
		// A ball that was put where the others see it confirms nothing.
		if (!view.included || !solved || !json || !center || ball.inferred) return [];
		// Used again since, it stands until the server says what it fails.
		const dropped = solved.failed === 'excluded' ? null : solved.failed;
		const tau = (group.policy.tau_percent / 100) * diagonal(view);
		return [{ view, camera: cameraFromJson(json), center, tau, dropped }];
	});
}

/** @param {Seen[]} seen @param {PolicyJson} policy @returns {PairSolutionJson[]} */
function pairsOf(seen, policy) {
	const pairs = [];
	for (let i = 0; i < seen.length; i++) {
		for (let j = i + 1; j < seen.length; j++) {
			const pair = solvePair(seen[i], seen[j], policy);
			if (pair) pairs.push(pair);
		}
	}
	return pairs;
}

/** @param {Seen} a @param {Seen} b @param {PolicyJson} policy @returns {PairSolutionJson | null} */
function solvePair(a, b, policy) {
	const point = triangulate(a.camera, a.center, b.camera, b.center);
	if (!point) return null;
	const first = reprojectionError(a.camera, point, a.center);
	const second = reprojectionError(b.camera, point, b.center);
	const apart = baseline(a.camera, b.camera);
	let failed = a.dropped ?? b.dropped;
	if (!failed && apart < policy.min_baseline_m) failed = 'baseline';
	const close = first <= a.tau && second <= b.tau;
	const inFront = isInFront(a.camera, point) && isInFront(b.camera, point);
	if (!failed && !(close && inFront)) failed = 'reprojection';
	return {
		a: a.view.key,
		b: b.view.key,
		point,
		errors_px: [first, second],
		baseline_m: apart,
		parallax_degrees: parallaxDegrees(a.camera, b.camera, point),
		valid: failed === null,
		failed,
	};
}

/** @param {PitchPoint[]} points @returns {PitchPoint | null} */
function mean(points) {
	if (points.length === 0) return null;
	const sum = points.reduce((total, point) => [
		total[0] + point[0], total[1] + point[1], total[2] + point[2],
	]);
	return [sum[0] / points.length, sum[1] / points.length, sum[2] / points.length];
}

/** @param {Seen[]} seen @param {PairSolutionJson[]} valid @param {PitchPoint} point */
function largestParallax(seen, valid, point) {
	/** @param {string} key */
	const camera = (key) => /** @type {Seen} */ (seen.find((one) => one.view.key === key)).camera;
	return Math.max(...valid.map(({ a, b }) => parallaxDegrees(camera(a), camera(b), point)));
}

/** @param {Seen} seen @param {PitchPoint} point @param {number} phi @returns {BallFitJson} */
export function fitBall({ view, camera, center }, point, phi) {
	const image = project(camera, point);
	const optimized = optimizedBall(camera, center, point, phi);
	const error = image && Math.hypot(image.x - center.x, image.y - center.y);
	const box = ballOf(view)?.box ?? null;
	return {
		reprojected: image && [image.x, image.y],
		error_px: error,
		error_percent: error === null ? null : (100 * error) / diagonal(view),
		optimized_diameter_px: optimized?.diameter ?? null,
		optimized_box: optimized && squareBox(center, optimized.diameter),
		optimized_error_m: optimized?.distance ?? null,
		exact_box: exactBox(camera, point, phi),
		size_ratio: box && optimized ? boxDiameter(box) / optimized.diameter : null,
		depth_m: depthOf(camera, point),
	};
}

/** @param {Camera} camera @param {PitchPoint} point */
function depthOf(camera, point) {
	const [x, y, z] = camera.R[2];
	return x * (point[0] - camera.C[0]) + y * (point[1] - camera.C[1]) + z * (point[2] - camera.C[2]);
}
