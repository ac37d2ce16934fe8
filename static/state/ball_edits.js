// @ts-check
/** Edits of one view's ball: a new one, hidden by somebody, not in the picture at all. */

import { boxDiameter, squareBox } from '../geometry/ball.js';
import { ballOf, diagonal } from '../geometry/preview.js';

/** @import {BallJson, GroupDocument, PointJson, SolutionJson, ViewJson, ViewSolutionJson} from '../api/types.js' */
/** @import {BallEdit} from './edits.js' */

/** Where nothing says how large a ball looks: this share of the diagonal. */
const TYPICAL_SHARE = 0.008;

/**
 * A new ball at a place.
 *
 * @param {ViewJson} view @param {PointJson} at @param {number} diameter pixels
 * @returns {BallEdit}
 */
export function newBall(view, at, diameter) {
	const ball = { box: squareBox(at, diameter), point: null, occluded: false, out_of_view: false };
	return { kind: 'ball', view: view.key, ball };
}

/**
 * The ball where the other views see it; it is drawn and exported, and confirms nothing.
 *
 * @param {ViewJson} view @param {NonNullable<ViewSolutionJson['expected']>} expected
 * @returns {BallEdit}
 */
export function placeBall(view, { place: [x, y], box }) {
	const { ball } = newBall(view, { x, y }, box ? boxDiameter(box) : TYPICAL_SHARE * diagonal(view));
	return { kind: 'ball', view: view.key, ball: ball && { ...ball, inferred: true } };
}

/**
 * How large a new ball should be: as the 3D ball looks from here, else as large as the others.
 *
 * @param {GroupDocument} group @param {SolutionJson | null} solution @param {ViewJson} view
 * @returns {number} pixels
 */
export function expectedDiameter(group, solution, view) {
	const fit = solution?.views.find((solved) => solved.view === view.key)?.ball;
	if (fit?.optimized_diameter_px) return fit.optimized_diameter_px;
	const expected = solution?.views.find((solved) => solved.view === view.key)?.expected?.box;
	if (expected) return boxDiameter(expected);
	const others = group.views.flatMap((other) => {
		const box = ballOf(other)?.box;
		return box ? [(boxDiameter(box) / diagonal(other)) * diagonal(view)] : [];
	});
	if (others.length === 0) return TYPICAL_SHARE * diagonal(view);
	return others.reduce((sum, one) => sum + one) / others.length;
}

/** Say that the ball of a view is hidden by somebody, or take that back. @param {ViewJson} view @returns {BallEdit | null} */
export function toggleOccluded(view) {
	const ball = ballOf(view);
	if (!ball) return null;
	return { kind: 'ball', view: view.key, ball: { ...ball, occluded: !ball.occluded } };
}

/** Whether somebody said that the ball is not in the picture. @param {ViewJson} view */
export function isOutOfView(view) {
	return view.balls.some((ball) => ball.out_of_view);
}

/** Balls that were said to be out of view in this window, by view. @type {Map<number, BallJson>} */
const gone = new Map();

/**
 * Say that the ball is not in the picture, or take that back: the ball that was there returns.
 *
 * @param {ViewJson} view @returns {BallEdit}
 */
export function toggleOutOfView(view) {
	if (isOutOfView(view)) return { kind: 'ball', view: view.key, ball: gone.get(view.id) ?? null };
	const present = ballOf(view);
	if (present) gone.set(view.id, present);
	else gone.delete(view.id);
	return { kind: 'ball', view: view.key, ball: { box: null, point: null, occluded: false, out_of_view: true } };
}
