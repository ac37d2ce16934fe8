// @ts-check
/** Whiskers from the projected markings to their paint. */

import { nearestOfPieces, piecesOf } from '../geometry/polyline.js';
import { gradeOfResidual } from '../geometry/residual.js';
import { drawResidualLine } from './points.js';

/** @import {PaintJson} from '../api/paint.js' */
/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {ViewPaint, ViewPicture} from './scene.js' */

/** Of the places of paint, which lie a few pixels apart, one in so many has a whisker. */
const EVERY = 3;

/**
 * The paint of a picture, ready to draw.
 *
 * @param {ViewPicture} picture @param {PaintJson} paint
 * @returns {ViewPaint}
 */
export function viewPaint(picture, paint) {
	const whiskers = picture.markings.flatMap(({ marking, polyline }) => whiskersOf(marking, polyline, paint, picture));
	return {
		found: paint,
		draw: (context, scene) => {
			for (const { point, nearest, distance } of whiskers) {
				drawResidualLine(context, scene, point, nearest, distance, gradeOfResidual(distance, picture.gamma));
			}
		},
		places: (marking) => (paint.points[marking] ?? []).map(([x, y]) => ({ x, y })),
	};
}

/** @param {string} marking @param {ImagePoint[]} polyline @param {PaintJson} paint @param {ViewPicture} picture */
function whiskersOf(marking, polyline, paint, { view }) {
	const pieces = piecesOf(polyline, view);
	return (paint.points[marking] ?? []).filter((_, i) => i % EVERY === 0).flatMap(([x, y]) => {
		const on = nearestOfPieces(pieces, { x, y });
		return on ? [{ point: { x, y }, nearest: on.point, distance: on.distance }] : [];
	});
}
