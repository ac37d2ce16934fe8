// @ts-check
/** Predicted balls: corner brackets with a tag, so that nobody takes them for what a person drew. */

import { colours } from '../lib/colours.js';
import { widthOf } from './pen.js';
import { placeMarks } from './prediction_places.js';

/** @import {Mark} from '../state/prediction_marks.js' */
/** @import {Rect} from './prediction_places.js' */
/** @import {Scene} from './scene.js' */

const ARM = { share: 0.32, least: 5, most: 14 };
const SMALL = 200;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawPredictions(context, { picture, viewport, selected }) {
	const marks = picture.predictions?.marks ?? [];
	const chosen = selected?.kind === 'prediction' && selected.view === picture.view.key ? selected.prediction : null;
	context.save();
	const placed = placeMarks(marks, viewport, picture.view.width, chosen);
	const colourOf = (/** @type {Mark} */ { id }) => (id === chosen ? colours.value.selected : colours.value.predicted);
	for (const { mark, box } of placed) strokeBrackets(context, box, colourOf(mark), mark.sure || mark.id === chosen);
	// On a small crop the brackets say enough.
	if (widthOf(context) >= SMALL) for (const { mark, tag, text } of placed) drawTag(context, tag, text, colourOf(mark));
	context.restore();
}

/** @param {CanvasRenderingContext2D} context @param {Rect} box @param {string} colour @param {boolean} sure */
function strokeBrackets(context, { left, top, width, height }, colour, sure) {
	const arm = Math.max(ARM.least, Math.min(ARM.most, ARM.share * Math.min(width, height)));
	context.beginPath();
	for (const [x, inward] of [[left, 1], [left + width, -1]]) {
		for (const [y, down] of [[top, 1], [top + height, -1]]) {
			context.moveTo(x + inward * arm, y);
			context.lineTo(x, y);
			context.lineTo(x, y + down * arm);
		}
	}
	context.lineJoin = 'miter';
	context.setLineDash([]);
	context.strokeStyle = colours.value.halo;
	context.lineWidth = 4.5;
	context.stroke();
	context.setLineDash(sure ? [] : [2, 2]);
	context.strokeStyle = colour;
	context.lineWidth = sure ? 2.25 : 1.5;
	context.stroke();
	context.setLineDash([]);
}

/** @param {CanvasRenderingContext2D} context @param {Rect} tag @param {string} text @param {string} colour */
function drawTag(context, { left, top, width, height }, text, colour) {
	context.font = '11px Inter, system-ui, "DejaVu Sans", sans-serif';
	context.textBaseline = 'middle';
	context.fillStyle = colours.value.plate;
	context.beginPath();
	context.roundRect(left, top, width, height, 4);
	context.fill();
	context.fillStyle = colour;
	context.fillText(text, left + 5, top + height / 2 + 0.5, width - 10);
}
