// @ts-check
/** Notes at their places. */

import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { label } from './pen.js';

/** @import {Scene} from './scene.js' */

const HEAD = 5;
const HEIGHT = 18;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawPins(context, { picture, viewport }) {
	for (const { at, text } of picture.pins) {
		const { x, y } = toScreen(viewport, at);
		context.beginPath();
		context.moveTo(x, y);
		context.lineTo(x, y - HEIGHT);
		context.lineWidth = 1.5;
		context.strokeStyle = colours.value.point;
		context.stroke();
		context.beginPath();
		context.arc(x, y - HEIGHT, HEAD, 0, 2 * Math.PI);
		context.fillStyle = colours.value.warn;
		context.fill();
		context.stroke();
		label(context, text, { x: x + HEAD + 8, y: y - HEIGHT }, colours.value.point);
	}
}
