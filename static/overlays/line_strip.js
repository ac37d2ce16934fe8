// @ts-check
/** The band beside a projected marking, straightened: a misfit is seen at a glance. */

import { frames, lengthOf, nearestOn } from '../geometry/polyline.js';
import { colours } from '../lib/colours.js';

/** @import {MarkingResiduals} from '../geometry/residual.js' */

/** Pixels of the annotated image to either side. */
const BAND = 12;

/**
 * @param {CanvasRenderingContext2D} context
 * @param {{width: number, height: number}} size CSS pixels
 * @param {MarkingResiduals} marking
 * @param {ImageData | null} pixels of the frame, null without one
 * @param {number} scale frame pixels per annotated pixel
 */
export function drawStrip(context, size, marking, pixels, scale) {
	context.fillStyle = colours.value.grass;
	context.fillRect(0, 0, size.width, size.height);
	if (pixels) context.drawImage(straighten(marking, size.width, pixels, scale), 0, 0, size.width, size.height);
	drawMiddle(context, size, marking);
	drawStripPoints(context, size, marking);
}

/**
 * @param {MarkingResiduals} marking @param {number} columns @param {ImageData} pixels
 * @param {number} scale
 */
function straighten(marking, columns, pixels, scale) {
	const rows = 2 * BAND + 1;
	const canvas = new OffscreenCanvas(columns, rows);
	const context = /** @type {OffscreenCanvasRenderingContext2D} */ (canvas.getContext('2d'));
	const strip = context.createImageData(columns, rows);
	frames(marking.polyline, columns).forEach(({ point, normal }, column) => {
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

/**
 * @param {CanvasRenderingContext2D} context @param {{width: number, height: number}} size
 * @param {MarkingResiduals} marking
 */
function drawStripPoints(context, { width, height }, marking) {
	const length = lengthOf(marking.polyline) || 1;
	for (const { point } of marking.points) {
		const on = nearestOn(marking.polyline, point);
		if (!on) continue;
		const x = Math.min(width - 4, Math.max(4, (on.along / length) * width));
		const off = Math.max(-BAND, Math.min(BAND, on.side));
		const y = height / 2 + (off / BAND) * (height / 2 - 4);
		context.beginPath();
		context.arc(x, y, 3, 0, 2 * Math.PI);
		context.fillStyle = colours.value.point;
		context.fill();
		context.lineWidth = 1.4;
		context.strokeStyle = colours.value[Math.abs(on.side) > BAND ? 'bad' : 'ink'];
		context.stroke();
	}
}
