// @ts-check
/** What one panel shows: values only, so that drawing is a function of them. */

import { ballOutline } from '../geometry/ball.js';
import { cameraFromJson } from '../geometry/camera.js';
import { epipolarSegment } from '../geometry/epipolar.js';
import { ballCenter, ballOf, diagonal } from '../geometry/preview.js';
import { residualsOf } from '../geometry/residual.js';
import { pinsOf } from '../lib/pins.js';

/** @import {BallFitJson, GroupDocument, SolutionJson, ViewJson, ViewSolutionJson} from '../api/types.js' */
/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {MarkingResiduals} from '../geometry/residual.js' */
/** @import {ScreenPoint, Viewport} from '../geometry/viewport.js' */
/** @import {Suggestion} from '../state/suggestions.js' */
/** @import {Mark, ViewMarks} from '../state/prediction_marks.js' */
/** @import {Selection} from '../state/workspace.js' */

/** @typedef {{letter: string, points: ImagePoint[]}} Epipolar */
/** @typedef {{at: ImagePoint, text: string}} Pin */
/** @typedef {(context: CanvasRenderingContext2D, scene: Scene) => void} Draw */
/** @typedef {(viewport: Viewport, at: ScreenPoint) => Mark | null} MarkAt */
/** @typedef {ViewMarks & {draw: Draw, at: MarkAt}} ViewPredictions   their code is loaded with them */
/**
 * @typedef {object} ViewPaint   its code is loaded with it
 * @property {Draw} draw whiskers from the markings to their paint
 * @property {(marking: string) => ImagePoint[]} places of the paint of a marking
 * @property {import('../api/paint.js').PaintJson} found what was read, and how the camera agrees with it
 */
/** @typedef {{item: import('../api/proposals.js').ViewProposalJson, draw: Draw}} ViewProposal   its code is loaded with it */
/**
 * @typedef {object} ViewPicture
 * @property {ViewJson} view
 * @property {ViewSolutionJson | null} solved
 * @property {BallFitJson | null} ball the 3D ball seen in this view
 * @property {number | null} apart when the view agrees with no other: its own error in its best pair, px
 * @property {number} gamma pixels
 * @property {number} tau largest error of a ball that two views agree on, pixels
 * @property {MarkingResiduals[]} markings
 * @property {ImagePoint[]} outline of the 3D ball
 * @property {Epipolar[]} epipolars rays of the other views' balls
 * @property {Pin[]} pins notes that stand at a place of this view
 * @property {ViewPredictions} [predictions] once they are known
 * @property {ViewPaint} [paint] once it is read, while it is shown
 * @property {Draw} [followed] draws a ball that was followed through the frames of its camera
 * @property {ViewProposal} [proposal] lines that are proposed, where there is no camera
 */
/**
 * @typedef {object} Scene
 * @property {ViewPicture} picture
 * @property {Viewport} viewport
 * @property {Selection | null} selected
 * @property {boolean} hidden
 * @property {boolean} projections
 * @property {boolean} boxes
 * @property {number} gain
 * @property {boolean} [draws] whether a click draws in this view
 * @property {boolean} rays
 * @property {import('../state/conflict.js').Field[]} [ghosts] what a conflict keeps beside what is shown
 * @property {Suggestion | null} [meant] what the card speaks about, in this view
 */

/**
 * Every view of a group, ready to draw.
 *
 * @param {GroupDocument} group as shown, edits included
 * @param {SolutionJson | null} solution
 * @param {GroupDocument | null} saved as the server knows it
 * @returns {ViewPicture[]}
 */
export function picturesOf(group, solution, saved) {
	const cameras = camerasOf(solution);
	return group.views.map((view) => {
		const solved = solution?.views.find((candidate) => candidate.view === view.key) ?? null;
		const camera = cameras.get(view.key);
		const gamma = (group.policy.jac_gamma_percent / 100) * diagonal(view);
		const point = solution?.ball?.point;
		// The solution measured the saved lines; others are measured here.
		const live = saved?.views.find(({ key }) => key === view.key)?.lines !== view.lines;
		return {
			view,
			solved,
			ball: solved?.ball ?? null,
			apart: apartOf(view.key, solution),
			gamma,
			tau: (group.policy.tau_percent / 100) * diagonal(view),
			markings: residualsOf(view.lines, solved?.calibration.markings ?? [], gamma, live),
			outline: camera && point ? ballOutline(camera, point, group.policy.ball_diameter_m) : [],
			epipolars: camera ? epipolarsInto(group, view, cameras) : [],
			pins: pinsOf(group.verdict.note, view.letter),
		};
	});
}

/**
 * The one error of a view's ball: to the 3D ball, or where the view agrees with no other, in its best pair.
 *
 * @param {string} key @param {SolutionJson | null} solution
 * @returns {number | null} pixels
 */
export function ballError(key, solution) {
	return apartOf(key, solution) ?? solution?.views.find(({ view }) => view === key)?.ball?.error_px ?? null;
}

/**
 * The error of a view in its best pair, as the table of pairs has it; null where it is in a valid one, or in none.
 *
 * @param {string} key @param {SolutionJson | null} solution @returns {number | null}
 */
function apartOf(key, solution) {
	const own = (solution?.pairs ?? []).filter(({ a, b }) => a === key || b === key);
	if (own.length === 0 || own.some(({ valid }) => valid)) return null;
	const worst = (/** @type {typeof own[0]} */ { errors_px }) => Math.max(...errors_px);
	const best = own.reduce((a, b) => (worst(b) < worst(a) ? b : a));
	return best.errors_px[best.a === key ? 0 : 1];
}

/**
 * Where the other views' rays run in a view, image points.
 *
 * @param {GroupDocument} group @param {SolutionJson | null} solution @param {ViewJson} view
 * @param {number} highest metres above the grass up to which they are followed
 * @returns {ImagePoint[]}
 */
export function raysInto(group, solution, view, highest) {
	return epipolarsInto(group, view, camerasOf(solution), highest).flatMap(({ points }) => points);
}

/** @param {SolutionJson | null} solution */
function camerasOf(solution) {
	return new Map((solution?.views ?? []).flatMap((solved) => (
		solved.calibration.camera ? [[solved.view, cameraFromJson(solved.calibration.camera)]] : []
	)));
}

/**
 * @param {GroupDocument} group @param {ViewJson} into
 * @param {Map<string, import('../geometry/camera.js').Camera>} cameras @param {number} [highest]
 * @returns {Epipolar[]}
 */
function epipolarsInto(group, into, cameras, highest) {
	const target = cameras.get(into.key);
	return group.views.flatMap((from) => {
		const source = cameras.get(from.key);
		const ball = ballOf(from);
		const center = ball && ballCenter(ball);
		if (from.key === into.key || !source || !target || !center) return [];
		return [{ letter: from.letter, points: epipolarSegment(source, center, target, highest) }];
	});
}
