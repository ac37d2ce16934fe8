// @ts-check
/** Paint that was seen in a frame: places along the markings, and all that looks like painted lines. */

import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';

/** @import {PaintJson} from '../api/paint.js' */
/** @import {Viewport} from '../geometry/viewport.js' */

const LIKE = 2;
const PLACE = 2;

/** @param {CanvasRenderingContext2D} context @param {Viewport} viewport @param {PaintJson} paint */
export function drawPaint(context, viewport, paint) {
	context.fillStyle = colours.value.warn;
	context.globalAlpha = 0.8;
	for (const place of paint.line_like) dot(context, viewport, place[0], place[1], LIKE);
	context.globalAlpha = 1;
	context.fillStyle = paint.reason === 'paint_disagrees' ? colours.value.bad : colours.value.reprojected;
	for (const places of Object.values(paint.points)) {
		for (const place of places) dot(context, viewport, place[0], place[1], PLACE);
	}
}

/** @param {CanvasRenderingContext2D} context @param {Viewport} viewport @param {number} x @param {number} y @param {number} side CSS pixels */
function dot(context, viewport, x, y, side) {
	const at = toScreen(viewport, { x, y });
	context.fillRect(at.x - side / 2, at.y - side / 2, side, side);
}
