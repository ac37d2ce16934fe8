// @ts-check
/** What the card on the right speaks about, pointed out on the picture. */

import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { shortMarking } from '../lib/format.js';
import { label, strokeLine, widthOf } from './pen.js';

/** @import {FixJson} from '../api/types.js' */
/** @import {Scene} from './scene.js' */

const RING = 11;
/** Whole panels in words need this much room, CSS pixels. */
const ROOMY = 330;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawMendMarks(context, scene) {
	const { meant } = scene;
	if (!meant) return;
	if (meant.action === 'swap_sides') plate(context, 'Left and right swapped?');
	else if (meant.action === 'look_ball' && meant.point) look(context, scene, meant.point);
	else if (meant.action === 'relabel' || meant.action === 'drop_marking') marking(context, scene, meant);
	else if (meant.action === 'move_point' || meant.action === 'drop_point') point(context, scene, meant);
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

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {[number, number]} to */
function look(context, { viewport }, [x, y]) {
	const at = toScreen(viewport, { x, y });
	ring(context, at, [4, 3]);
	label(context, 'is the ball here?', { x: at.x + RING + 8, y: at.y - RING - 4 }, colours.value.selected);
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {FixJson} meant */
function marking(context, { picture, viewport }, meant) {
	const points = picture.view.lines[meant.marking ?? ''] ?? [];
	if (points.length === 0) return;
	strokeLine(context, viewport, points, { colour: colours.value.selected, width: 3, halo: true });
	const at = toScreen(viewport, points[Math.floor(points.length / 2)]);
	const name = shortMarking(meant.marking ?? '');
	const text = meant.action === 'relabel' && meant.to ? `${name} → ${shortMarking(meant.to)}` : `${name}: fits nothing`;
	if (widthOf(context) >= ROOMY) label(context, text, { x: at.x + 14, y: at.y - 16 }, colours.value.selected);
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {FixJson} meant */
function point(context, { picture, viewport }, meant) {
	const fit = picture.markings.find((one) => one.marking === meant.marking);
	const found = fit?.points[meant.index ?? -1];
	if (!found) return;
	const at = toScreen(viewport, found.point);
	const to = meant.point ? { x: meant.point[0], y: meant.point[1] } : found.nearest;
	if (to) strokeLine(context, viewport, [found.point, to], { colour: colours.value.selected, width: 2, dash: [4, 3], halo: true });
	ring(context, at);
	const text = `point ${(meant.index ?? 0) + 1} of ${shortMarking(meant.marking ?? '')}`;
	if (widthOf(context) >= ROOMY) label(context, text, { x: at.x + RING + 8, y: at.y - RING - 4 }, colours.value.selected);
}
