// @ts-check
/** What the card on the right speaks about, pointed out on the picture. */

import { ballCenter } from '../geometry/preview.js';
import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { label, strokeLine, widthOf } from './pen.js';

/** @import {PairJson} from '../api/types.js' */
/** @import {Suggestion} from '../state/suggestions.js' */
/** @import {Scene} from './scene.js' */

const RING = 11;
/** Whole panels in words need this much room, CSS pixels. */
const ROOMY = 330;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawSuggestionMarks(context, scene) {
	const { meant } = scene;
	// Nothing is pointed out that has no words: undrawn lines and missing balls stand there already.
	if (!meant?.caption) return;
	const { marking, caption, guide, edit } = meant;
	const ball = edit?.kind === 'ball' && edit.ball ? ballCenter(edit.ball) : null;
	if (guide?.looks) look(context, scene, guide.looks, caption);
	else if (ball) look(context, scene, [ball.x, ball.y], caption);
	else if (marking && typeof meant.index === 'number') point(context, scene, meant);
	else if (marking) line(context, scene, marking, caption);
	else plate(context, caption);
}

/** Words about the whole view. @param {CanvasRenderingContext2D} context @param {string} text */
function plate(context, text) {
	context.font = '12px Inter, system-ui, "DejaVu Sans", sans-serif';
	const { width } = context.measureText(text);
	label(context, text, { x: (widthOf(context) - width) / 2, y: 48 }, colours.value.selected);
}

/** @param {CanvasRenderingContext2D} context @param {{x: number, y: number}} at @param {number[]} [dash] */
function ring(context, { x, y }, dash = []) {
	for (const [colour, width] of /** @type {[string, number][]} */ ([[colours.value.halo, 5], [colours.value.selected, 2.5]])) {
		context.beginPath();
		context.arc(x, y, RING, 0, 2 * Math.PI);
		context.setLineDash(dash);
		context.lineWidth = width;
		context.strokeStyle = colour;
		context.stroke();
	}
	context.setLineDash([]);
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {PairJson} to @param {string} caption */
function look(context, { viewport }, [x, y], caption) {
	const at = toScreen(viewport, { x, y });
	ring(context, at, [4, 3]);
	label(context, caption, { x: at.x + RING + 8, y: at.y - RING - 4 }, colours.value.selected);
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {string} marking @param {string} caption */
function line(context, { picture, viewport }, marking, caption) {
	const points = picture.view.lines[marking] ?? [];
	if (points.length === 0) return;
	strokeLine(context, viewport, points, { colour: colours.value.selected, width: 3, halo: true });
	const at = toScreen(viewport, points[Math.floor(points.length / 2)]);
	beside(context, caption, { x: at.x + 14, y: at.y - 16 });
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Suggestion} meant */
function point(context, { picture, viewport }, meant) {
	const fit = picture.markings.find((one) => one.marking === meant.marking);
	const found = fit?.points[meant.index ?? -1];
	if (!found) return;
	const at = toScreen(viewport, found.point);
	const to = meant.point ? { x: meant.point[0], y: meant.point[1] } : found.nearest;
	if (to) strokeLine(context, viewport, [found.point, to], { colour: colours.value.selected, width: 2, dash: [4, 3], halo: true });
	ring(context, at);
	beside(context, meant.caption, { x: at.x + RING + 8, y: at.y - RING - 4 });
}

/** Words beside a place, where there is room. @param {CanvasRenderingContext2D} context @param {string} caption @param {{x: number, y: number}} at */
function beside(context, caption, at) {
	if (widthOf(context) >= ROOMY) label(context, caption, at, colours.value.selected);
}
