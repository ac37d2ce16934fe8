// @ts-check
/** What the editor draws on top of the review screen's overlays. */

import { piecesOf } from '../../geometry/polyline.js';
import { toScreen } from '../../geometry/viewport.js';
import { colours } from '../../lib/colours.js';
import { drawPaint } from '../../overlays/paint.js';
import { strokeLine, strokeLines } from '../../overlays/pen.js';

/** @import {PaintJson} from '../../api/paint.js' */
/** @import {LinesJson} from '../../api/types.js' */
/** @import {MarkingResiduals} from '../../geometry/residual.js' */
/** @import {ImagePoint, Size, Viewport} from '../../geometry/viewport.js' */
/** @import {Choice} from '../../state/calibration.js' */

/**
 * @typedef {object} EditorMarks
 * @property {Viewport} viewport
 * @property {Size} size of the image
 * @property {LinesJson} lines as shown
 * @property {MarkingResiduals[]} fits of the camera as shown
 * @property {ImagePoint[][]} saved where the saved camera puts the markings; empty without changes
 * @property {Choice | null} choice
 * @property {string | null} hovered
 * @property {PaintJson | null} paint null while it is not shown
 */

const NUMBERS_UP_TO = 40;

/** @param {CanvasRenderingContext2D} context @param {EditorMarks} marks */
export function drawEditorMarks(context, marks) {
	const { viewport, size, saved, hovered, choice, paint } = marks;
	if (paint) drawPaint(context, viewport, paint);
	for (const polyline of saved) {
		strokeLines(context, viewport, piecesOf(polyline, size), { colour: colours.value.unseen, width: 1.25, dash: [2, 5], halo: false });
	}
	if (hovered && hovered !== choice?.marking) light(context, marks, hovered, 3);
	if (choice) {
		light(context, marks, choice.marking, 2.25);
		numbers(context, marks, choice.marking);
	}
}

/** @param {CanvasRenderingContext2D} context @param {EditorMarks} marks @param {string} marking @param {number} width */
function light(context, { viewport, size, lines, fits }, marking, width) {
	const colour = colours.value.selected;
	const projected = fits.find((fit) => fit.marking === marking)?.polyline ?? [];
	strokeLines(context, viewport, piecesOf(projected, size), { colour, width });
	const points = lines[marking] ?? [];
	strokeLine(context, viewport, points, { colour, width: 1, dash: [1, 3], halo: false });
	for (const point of points) {
		const { x, y } = toScreen(viewport, point);
		context.beginPath();
		context.arc(x, y, 5, 0, 2 * Math.PI);
		context.lineWidth = 2;
		context.strokeStyle = colour;
		context.stroke();
	}
}

/** The order of the points: it is the order of the line. @param {CanvasRenderingContext2D} context @param {EditorMarks} marks @param {string} marking */
function numbers(context, { viewport, lines }, marking) {
	const points = lines[marking] ?? [];
	if (points.length > NUMBERS_UP_TO) return;
	context.font = '11px Inter, system-ui, "DejaVu Sans", sans-serif';
	context.textBaseline = 'middle';
	points.forEach((point, i) => {
		const { x, y } = toScreen(viewport, point);
		context.lineWidth = 3;
		context.lineJoin = 'round';
		context.strokeStyle = colours.value.plate;
		context.strokeText(String(i + 1), x + 8, y + 9);
		context.fillStyle = colours.value.point;
		context.fillText(String(i + 1), x + 8, y + 9);
	});
}
