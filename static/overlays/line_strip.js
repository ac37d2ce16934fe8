// @ts-check
/** The band beside a projected marking, straightened: a misfit is seen at a glance. */

import { framesOf, lengthOf, nearestOfPieces, piecesOf } from '../geometry/polyline.js';
import { colours } from '../lib/colours.js';

/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {MarkingResiduals} from '../geometry/residual.js' */

/** Pixels of the annotated image to either side. */
const BAND = 12;

/**
 * @param {CanvasRenderingContext2D} context
 * @param {{width: number, height: number}} size CSS pixels
 * @param {MarkingResiduals} marking
 * @param {ImageData | null} pixels of the frame, null without one
 * @param {number} scale frame pixels per annotated pixel
 * @param {{width: number, height: number}} image annotated size
 * @param {ImagePoint[]} paint places of the marking's paint, where it is shown
 */
export function drawStrip(context, size, marking, pixels, scale, image, paint) {
	const pieces = piecesOf(marking.polyline, image);
	context.fillStyle = colours.value.grass;
	context.fillRect(0, 0, size.width, size.height);
	if (pixels) context.drawImage(straighten(pieces, size.width, pixels, scale), 0, 0, size.width, size.height);
	drawMiddle(context, size, marking);
	drawStripPaint(context, size, paint, pieces);
	drawStripPoints(context, size, marking, pieces);
}

/**
 * @param {ImagePoint[][]} pieces @param {number} columns @param {ImageData} pixels
 * @param {number} scale
 */
function straighten(pieces, columns, pixels, scale) {
	const rows = 2 * BAND + 1;
	const canvas = new OffscreenCanvas(columns, rows);
	const context = /** @type {OffscreenCanvasRenderingContext2D} */ (canvas.getContext('2d'));
	const strip = context.createImageData(columns, rows);
	framesOf(pieces, columns).forEach(({ point, normal }, column) => {
		for (let row = 0; row < rows; row++) {
			const off = row - BAND;
			const x = Math.round((point.x + normal.x * off + 0.5) * scale - 0.5);
			const y = Math.round((point.y + normal.y * off + 0.5) * scale - 0.5);
			copyPixel(pixels, x, y, strip, column, row);
		}
	});
	context.putImageData(strip, 0, 0);
	return canvas;
}

/**
 * @param {ImageData} from @param {number} x @param {number} y
 * @param {ImageData} to @param {number} column @param {number} row
 */
function copyPixel(from, x, y, to, column, row) {
	if (x < 0 || y < 0 || x >= from.width || y >= from.height) return;
	const source = 4 * (y * from.width + x);
	const target = 4 * (row * to.width + column);
	for (let k = 0; k < 4; k++) to.data[target + k] = from.data[source + k];
}

/**
 * @param {CanvasRenderingContext2D} context @param {{width: number, height: number}} size
 * @param {MarkingResiduals} marking
 */
function drawMiddle(context, { width, height }, marking) {
	context.fillStyle = colours.value[marking.grade];
	context.fillRect(0, height / 2 - 0.75, width, 1.5);
}

/** The middle of the paint, as it was read. */
/** @param {CanvasRenderingContext2D} context @param {{width: number, height: number}} size @param {ImagePoint[]} paint @param {ImagePoint[][]} pieces */
function drawStripPaint(context, { width, height }, paint, pieces) {
	const place = placer(width, height, pieces);
	context.fillStyle = colours.value.reprojected;
	for (const point of paint) {
		const on = place(point);
		if (on) context.fillRect(on.x - 1, on.y - 1, 2, 2);
	}
}

/**
 * From image points to where they stand in a band.
 *
 * @param {number} width @param {number} height @param {ImagePoint[][]} pieces
 * @returns {(point: ImagePoint) => {x: number, y: number, side: number} | null}
 */
function placer(width, height, pieces) {
	const length = pieces.reduce((sum, piece) => sum + lengthOf(piece), 0) || 1;
	return (point) => {
		const on = nearestOfPieces(pieces, point);
		if (!on) return null;
		const off = Math.max(-BAND, Math.min(BAND, on.side));
		return {
			x: Math.min(width - 4, Math.max(4, (on.along / length) * width)),
			y: height / 2 + (off / BAND) * (height / 2 - 4),
			side: on.side,
		};
	};
}

/**
 * @param {CanvasRenderingContext2D} context @param {{width: number, height: number}} size
 * @param {MarkingResiduals} marking @param {ImagePoint[][]} pieces
 */
function drawStripPoints(context, { width, height }, marking, pieces) {
	const place = placer(width, height, pieces);
	for (const { point } of marking.points) {
		const on = place(point);
		if (!on) continue;
		const { x, y } = on;
		context.beginPath();
		context.arc(x, y, 3, 0, 2 * Math.PI);
		context.fillStyle = colours.value.point;
		context.fill();
		context.lineWidth = 1.4;
		context.strokeStyle = colours.value[Math.abs(on.side) > BAND ? 'bad' : 'ink'];
		context.stroke();
	}
}
