// @ts-check
/** What lies under the pointer: the nearest thing that can be taken hold of. */

import { ballCenter, ballOf } from '../geometry/preview.js';
import { toScreen } from '../geometry/viewport.js';
import { CORNERS_FROM } from '../overlays/sizes.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {ScreenPoint, Viewport} from '../geometry/viewport.js' */
/** @import {Selection} from '../state/workspace.js' */

/** @typedef {{kind: 'point', marking: string, index: number}} PointHit */
/** @typedef {{kind: 'ball'}} BallHit */
/** @typedef {{kind: 'corner', left: boolean, top: boolean}} CornerHit */
/** @typedef {{kind: 'prediction', prediction: number}} PredictionHit */
/** @typedef {PointHit | BallHit | CornerHit | PredictionHit} Hit */
/** @typedef {(viewport: Viewport, at: ScreenPoint) => {id: number} | null} PredictionAt   what is predicted at a place */

const REACH = 11;
const CORNER_REACH = 7;

/**
 * @param {ViewJson} view @param {Viewport} viewport @param {ScreenPoint} at
 * @param {Selection | null} selected @param {PredictionAt} [predictionAt]
 * @returns {Hit | null}
 */
export function hitTest(view, viewport, at, selected, predictionAt) {
	const chosen = selected?.kind === 'ball' && selected.view === view.key;
	const corner = chosen ? hitCorner(view, viewport, at) : null;
	if (corner) return corner;
	const point = hitPoint(view, viewport, at);
	const ball = hitBall(view, viewport, at);
	// Where a point lies on the ball the nearer of the two is meant.
	if (point && ball !== null) return point.distance < ball ? point.hit : { kind: 'ball' };
	if (point) return point.hit;
	if (ball !== null) return { kind: 'ball' };
	// What people said is on top of what was predicted, whose tag stands beside it.
	const predicted = predictionAt?.(viewport, at);
	return predicted ? { kind: 'prediction', prediction: predicted.id } : null;
}

/** @param {ViewJson} view @param {Viewport} viewport @param {ScreenPoint} at */
function hitPoint(view, viewport, at) {
	/** @type {{hit: PointHit, distance: number} | null} */
	let best = null;
	for (const [marking, points] of Object.entries(view.lines)) {
		points.forEach((point, index) => {
			const { x, y } = toScreen(viewport, point);
			const distance = Math.hypot(x - at.x, y - at.y);
			if (distance > REACH || (best && best.distance <= distance)) return;
			best = { hit: { kind: 'point', marking, index }, distance };
		});
	}
	return /** @type {{hit: PointHit, distance: number} | null} */ (best);
}

/** @param {ViewJson} view @param {Viewport} viewport @param {ScreenPoint} at @returns {number | null} */
function hitBall(view, viewport, at) {
	const ball = ballOf(view);
	const center = ball && ballCenter(ball);
	if (!ball || !center) return null;
	const { x, y } = toScreen(viewport, center);
	const [halfWidth, halfHeight] = ball.box
		? [(ball.box[2] * viewport.scale) / 2, (ball.box[3] * viewport.scale) / 2] : [0, 0];
	const beyondX = Math.max(0, Math.abs(at.x - x) - halfWidth);
	const beyondY = Math.max(0, Math.abs(at.y - y) - halfHeight);
	return Math.hypot(beyondX, beyondY) <= REACH ? Math.hypot(at.x - x, at.y - y) : null;
}

/** @param {ViewJson} view @param {Viewport} viewport @param {ScreenPoint} at @returns {CornerHit | null} */
function hitCorner(view, viewport, at) {
	const box = ballOf(view)?.box;
	if (!box || Math.min(box[2], box[3]) * viewport.scale < CORNERS_FROM) return null;
	for (const left of [true, false]) {
		for (const top of [true, false]) {
			const { x, y } = toScreen(viewport, {
				x: box[0] + (left ? 0 : box[2]), y: box[1] + (top ? 0 : box[3]),
			});
			if (Math.max(Math.abs(x - at.x), Math.abs(y - at.y)) <= CORNER_REACH) {
				return { kind: 'corner', left, top };
			}
		}
	}
	return null;
}
