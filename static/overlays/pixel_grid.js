// @ts-check
/** The borders of the frame's own pixels, where they are large enough to be told apart. */

import { colours } from '../lib/colours.js';

/** @import {Size, Viewport} from '../geometry/viewport.js' */

/** CSS pixels that a pixel of the frame must have. */
const FROM = 8;

/**
 * @param {CanvasRenderingContext2D} context @param {Viewport} viewport @param {Size} panel
 * @param {number} step annotated pixels per pixel of the frame
 */
export function drawPixelGrid(context, viewport, panel, step) {
	const cell = viewport.scale * step;
	if (cell < FROM) return;
	context.beginPath();
	for (let x = viewport.left + cell * Math.ceil(-viewport.left / cell); x < panel.width; x += cell) {
		context.moveTo(Math.round(x) + 0.5, 0);
		context.lineTo(Math.round(x) + 0.5, panel.height);
	}
	for (let y = viewport.top + cell * Math.ceil(-viewport.top / cell); y < panel.height; y += cell) {
		context.moveTo(0, Math.round(y) + 0.5);
		context.lineTo(panel.width, Math.round(y) + 0.5);
	}
	context.lineWidth = 1;
	context.setLineDash([]);
	context.strokeStyle = colours.value.grid;
	context.stroke();
}
