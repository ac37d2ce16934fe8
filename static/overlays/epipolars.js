// @ts-check
/** The rays of the other views' balls, from the grass to 30 m above it. */

import { toScreen } from '../geometry/viewport.js';
import { colours, viewColour } from '../lib/colours.js';
import { label, strokeLine, widthOf } from './pen.js';

/** @import {Scene} from './scene.js' */

const DOTS = [3, 5];
/** How far beside its line a letter stands, CSS pixels. */
const BESIDE = 12;

/** Of a line that runs miles out of the picture browsers draw no dots. @param {{x: number, y: number}} at @param {number} width */
function isNear({ x, y }, width) {
	return Math.abs(x) < 3 * width && Math.abs(y) < 3 * width;
}

/**
 * Where the letter of a ray stands: beside the end at which the line comes into sight, far from where the ball is likely to be.
 *
 * @param {{x: number, y: number}[]} line CSS pixels, from the other camera to the grass
 * @param {{width: number, height: number}} seen part of the panel
 */
function letterPlace(line, { width, height }) {
	const inside = line.filter(({ x, y }) => x >= 0 && y >= 0 && x <= width && y <= height);
	const [first, last] = [inside[0], inside.at(-1)];
	if (!first || !last) return null;
	// A ball on the grass is at the end: the letter goes to the other one.
	return { x: first.x + BESIDE, y: Math.min(height - BESIDE, Math.max(BESIDE, first.y + (first.y < last.y ? BESIDE : -BESIDE))) };
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawEpipolars(context, { picture, viewport }) {
	for (const { letter, points } of picture.epipolars) {
		const near = points.filter((point) => isNear(toScreen(viewport, point), widthOf(context)));
		// Dots on dots: a dark line below them would look like one of the field's.
		strokeLine(context, viewport, near, { colour: colours.value.ink, width: 4.5, dash: DOTS, halo: false });
		strokeLine(context, viewport, near, { colour: viewColour(letter), width: 2.5, dash: DOTS, halo: false });
		const at = letterPlace(near.map((point) => toScreen(viewport, point)), {
			width: Math.min(widthOf(context), viewport.left + picture.view.width * viewport.scale),
			height: viewport.top + picture.view.height * viewport.scale,
		});
		if (at) label(context, letter, at, viewColour(letter));
	}
}
