// @ts-check
/** Lines that were proposed from the paint: violet and dashed, so that nobody takes them for somebody's. */

import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { label, strokeLine, widthOf } from './pen.js';

/** @import {LinesJson} from '../api/types.js' */
/** @import {Draw} from './scene.js' */

const DASH = [9, 5];
const SMALL = 200;

/** What draws the proposed lines of a view. @param {LinesJson} lines @returns {Draw} */
export function proposalDrawing(lines) {
	return (context, { viewport }) => {
		const colour = colours.value.predicted;
		const named = widthOf(context) >= SMALL;
		for (const [marking, points] of Object.entries(lines)) {
			strokeLine(context, viewport, points, { colour, width: 2, dash: DASH });
			const middle = points[points.length >> 1];
			if (!named || !middle) continue;
			const { x, y } = toScreen(viewport, middle);
			label(context, `${marking}?`, { x: x + 8, y: y - 10 }, colour);
		}
	};
}
