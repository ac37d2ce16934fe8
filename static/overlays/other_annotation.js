// @ts-check
/** What somebody else drew in a view: thin and dashed, below one's own. */

import { colours } from '../lib/colours.js';
import { strokeBox, strokeLine } from './pen.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {Viewport} from '../geometry/viewport.js' */

/**
 * @param {CanvasRenderingContext2D} context
 * @param {{view: ViewJson, viewport: Viewport, marked: string | null}} other marked: a marking to point out
 */
export function drawOther(context, { view, viewport, marked }) {
	const colour = colours.value.predicted;
	for (const [marking, points] of Object.entries(view.lines)) {
		const wide = marking === marked;
		strokeLine(context, viewport, points, { colour, width: wide ? 3 : 1.25, dash: [6, 4], halo: wide });
	}
	for (const { box, out_of_view: gone } of view.balls) {
		if (box && !gone) strokeBox(context, viewport, box, { colour, width: 1.25, dash: [4, 3] });
	}
}

/**
 * One's own line that is spoken about.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {{view: ViewJson, viewport: Viewport, marked: string | null}} own
 */
export function drawMarked(context, { view, viewport, marked }) {
	const points = marked === null ? undefined : view.lines[marked];
	if (points) strokeLine(context, viewport, points, { colour: colours.value.selected, width: 2.5, halo: true });
}
