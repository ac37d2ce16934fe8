// @ts-check
/** Strokes that every overlay uses; places in image pixels, widths in CSS pixels. */

import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { markShare } from './sizes.js';

/** @import {ImagePoint, Viewport} from '../geometry/viewport.js' */
/** @typedef {{colour: string, width: number, dash?: number[], halo?: boolean, closed?: boolean}} Stroke */

/** Captions and tools stand along the upper border of a panel, CSS pixels. */
export const UPPER_BORDER = 48;
/** Thinner lines are not told apart by their colour, CSS pixels. */
const THINNEST = 1.1;
/** Below this share words are smaller too. */
const SMALL_WORDS = 0.75;

/**
 * A line through image points.
 *
 * @param {CanvasRenderingContext2D} context @param {Viewport} viewport
 * @param {ImagePoint[]} points @param {Stroke} stroke
 */
export function strokeLine(context, viewport, points, stroke) {
	if (points.length < 2) return;
	context.beginPath();
	points.forEach((point, i) => {
		const { x, y } = toScreen(viewport, point);
		if (i === 0) context.moveTo(x, y);
		else context.lineTo(x, y);
	});
	if (stroke.closed) context.closePath();
	strokePath(context, stroke);
}

/**
 * Several lines with one stroke.
 *
 * @param {CanvasRenderingContext2D} context @param {Viewport} viewport
 * @param {ImagePoint[][]} lines @param {Stroke} stroke
 */
export function strokeLines(context, viewport, lines, stroke) {
	for (const line of lines) strokeLine(context, viewport, line, stroke);
}

/** @param {CanvasRenderingContext2D} context @param {Stroke} stroke */
function strokePath(context, { colour, width, dash = [], halo = true }) {
	const share = shareOf(context);
	const thick = Math.max(THINNEST, width * share);
	context.lineJoin = 'round';
	context.lineCap = 'butt';
	context.setLineDash([]);
	if (halo) {
		context.strokeStyle = colours.value.halo;
		context.lineWidth = thick + 2 * share;
		context.stroke();
	}
	context.setLineDash(dash);
	context.strokeStyle = colour;
	context.lineWidth = thick;
	context.stroke();
	context.setLineDash([]);
}

/**
 * @param {CanvasRenderingContext2D} context @param {Viewport} viewport
 * @param {readonly [number, number, number, number]} box @param {Stroke} stroke
 */
export function strokeBox(context, viewport, [x, y, width, height], stroke) {
	const corners = [
		{ x, y }, { x: x + width, y }, { x: x + width, y: y + height }, { x, y: y + height },
	];
	strokeLine(context, viewport, corners, { ...stroke, closed: true });
}

/**
 * A cross with an open middle, so that it hides nothing of what it points at.
 *
 * @param {CanvasRenderingContext2D} context @param {{x: number, y: number}} at CSS pixels
 * @param {number} inner @param {number} outer @param {Stroke} stroke
 */
export function strokeCross(context, { x, y }, inner, outer, stroke) {
	context.beginPath();
	for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
		context.moveTo(x + dx * inner, y + dy * inner);
		context.lineTo(x + dx * outer, y + dy * outer);
	}
	strokePath(context, stroke);
}

/** Width of what is drawn on, CSS pixels. @param {CanvasRenderingContext2D} context */
export function widthOf(context) {
	return context.canvas.width / devicePixelRatio;
}

/** Height of what is drawn on, CSS pixels. @param {CanvasRenderingContext2D} context */
export function heightOf(context) {
	return context.canvas.height / devicePixelRatio;
}

/** How large marks are drawn there. @param {CanvasRenderingContext2D} context @returns {number} a share */
export function shareOf(context) {
	return markShare(widthOf(context));
}

/**
 * A word beside a place, on a dark plate.
 *
 * @param {CanvasRenderingContext2D} context @param {string} text
 * @param {{x: number, y: number}} at CSS pixels, left middle
 * @param {string} colour
 */
export function label(context, text, { x, y }, colour) {
	const small = shareOf(context) < SMALL_WORDS;
	context.font = `${small ? 11 : 12}px Inter, system-ui, "DejaVu Sans", sans-serif`;
	context.textBaseline = 'middle';
	const { width } = context.measureText(text);
	const last = widthOf(context) - width - 10;
	const left = Math.max(10, Math.min(x, last));
	context.fillStyle = colours.value.plate;
	context.beginPath();
	const half = small ? 8 : 10;
	context.roundRect(left - 5, y - half, width + 10, 2 * half, 5);
	context.fill();
	context.fillStyle = colour;
	context.fillText(text, left, y + 0.5);
}
