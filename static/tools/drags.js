// @ts-check
/**
 * Gestures that become edits. A drag knows where it began, proposes an edit at every step and
 * submits the last one; nothing is sent when the pointer came back or never moved.
 */

import { boxCenter } from '../geometry/ball.js';
import { ballOf } from '../geometry/preview.js';
import { movePoint } from '../state/edits.js';
import { draft, propose, submit, withdraw } from '../state/group.js';

/** @import {BallJson, BoxJson, ViewJson} from '../api/types.js' */
/** @import {ImagePoint} from '../geometry/viewport.js' */
/** @import {Edit} from '../state/edits.js' */
/** @import {Drag} from './gesture.js' */
/** @import {Hit} from './hit.js' */

const SMALLEST = 2;

/**
 * The drag that a hit starts.
 *
 * @param {ViewJson} view @param {Hit} hit @param {ImagePoint} from
 * @returns {Drag | null}
 */
export function dragOf(view, hit, from) {
	if (hit.kind === 'point') return pointDrag(view, hit.marking, hit.index, from);
	const ball = ballOf(view);
	if (!ball || hit.kind === 'prediction') return null;
	if (hit.kind === 'corner') return ball.box ? cornerDrag(view, ball, ball.box, hit) : null;
	return ballDrag(view, ball, from);
}

/** @param {(to: ImagePoint) => Edit} edit @returns {Drag} */
function drag(edit) {
	return {
		move: (to) => propose(edit(to)),
		end: (moved) => { if (moved && draft.value) submit(draft.value); },
		cancel: withdraw,
	};
}

/** @param {ViewJson} view @param {string} marking @param {number} index @param {ImagePoint} from */
function pointDrag(view, marking, index, from) {
	const point = view.lines[marking][index];
	// The point keeps its distance from the pointer: it does not jump when it is taken.
	return drag((to) => movePoint(view, marking, index, {
		x: point.x + to.x - from.x, y: point.y + to.y - from.y,
	}));
}

/** @param {ViewJson} view @param {BallJson} ball @param {ImagePoint} from */
function ballDrag(view, ball, from) {
	return drag((to) => moveBall(view, ball, to.x - from.x, to.y - from.y));
}

/**
 * @param {ViewJson} view @param {BallJson} ball @param {number} dx @param {number} dy
 * @returns {Edit}
 */
export function moveBall(view, ball, dx, dy) {
	const { box, point } = ball;
	return {
		kind: 'ball',
		view: view.key,
		ball: {
			...ball,
			inferred: false,
			box: box && [box[0] + dx, box[1] + dy, box[2], box[3]],
			point: point && [point[0] + dx, point[1] + dy],
		},
	};
}

/**
 * The ball's box grown about its centre; null for a ball that is a point.
 *
 * @param {ViewJson} view @param {BallJson} ball @param {number} by pixels of diameter
 * @returns {Edit | null}
 */
export function growBall(view, ball, by) {
	if (!ball.box) return null;
	const center = boxCenter(ball.box);
	const width = Math.max(SMALLEST, ball.box[2] + by);
	const height = Math.max(SMALLEST, ball.box[3] + by);
	/** @type {BoxJson} */
	const box = [center.x - width / 2, center.y - height / 2, width, height];
	return { kind: 'ball', view: view.key, ball: { ...ball, inferred: false, box } };
}

/**
 * @param {ViewJson} view @param {BallJson} ball @param {BoxJson} box
 * @param {{left: boolean, top: boolean}} corner
 */
function cornerDrag(view, ball, [x, y, width, height], { left, top }) {
	const fixed = { x: left ? x + width : x, y: top ? y + height : y };
	return drag((to) => {
		const w = Math.max(SMALLEST, left ? fixed.x - to.x : to.x - fixed.x);
		const h = Math.max(SMALLEST, top ? fixed.y - to.y : to.y - fixed.y);
		/** @type {BoxJson} */
		const resized = [left ? fixed.x - w : fixed.x, top ? fixed.y - h : fixed.y, w, h];
		return { kind: 'ball', view: view.key, ball: { ...ball, inferred: false, box: resized } };
	});
}
