// @ts-check
/** Lines that the camera sees and nobody has drawn: ghosts that stand out on grass and on white paint. */

import { piecesOf } from '../geometry/polyline.js';
import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { heightOf, label, strokeLines, UPPER_BORDER, widthOf } from './pen.js';

/** @import {Scene} from './scene.js' */

/** Shorter ones get a ring, so that a stub at the border is found, CSS pixels. */
const STUB = 24;
const RING = 13;
/** Of words from the line, CSS pixels. */
const BESIDE = 22;
/** Panels narrower than this have no room for names. */
const ROOMY = 420;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawUndrawn(context, { picture, viewport, meant, draws }) {
	for (const { marking, points, polyline } of picture.markings) {
		if (points.length > 0 || polyline.length < 2) continue;
		const named = meant?.guide?.draws === marking;
		// White on black is seen on everything; the gaps let the paint through.
		const pieces = piecesOf(polyline, picture.view);
		strokeLines(context, viewport, pieces, { colour: colours.value.ink, width: named ? 5 : 3.5, dash: [2, 7], halo: false });
		strokeLines(context, viewport, pieces, {
			colour: named ? colours.value.selected : colours.value.point, width: named ? 2.5 : 1.5, dash: [2, 7], halo: false,
		});
		// While one draws, the words would stand in the way, and the chip below has them.
		if (named && !draws) point(context, marking, polyline.map((at) => toScreen(viewport, at)));
	}
}

/** @param {CanvasRenderingContext2D} context @param {string} marking @param {{x: number, y: number}[]} places */
function point(context, marking, places) {
	const middle = places[Math.floor(places.length / 2)];
	const [first, last] = [places[0], places[places.length - 1]];
	if (Math.hypot(first.x - last.x, first.y - last.y) < STUB) {
		context.beginPath();
		context.arc(middle.x, middle.y, RING, 0, 2 * Math.PI);
		context.lineWidth = 2;
		context.strokeStyle = colours.value.selected;
		context.stroke();
	}
	const text = widthOf(context) < ROOMY ? marking : `${marking}: not drawn`;
	const ys = places.map(({ y }) => y);
	// Above or below the line, never on it, and not under what stands along the upper border.
	const above = Math.min(...ys) - BESIDE;
	const y = above > UPPER_BORDER ? above : Math.min(Math.max(...ys) + BESIDE, heightOf(context) - BESIDE);
	label(context, text, { x: middle.x, y }, colours.value.selected);
}
