// @ts-check
/** How close one has to come to see some points of an image well. */

/** @import {ImagePoint, Size} from './viewport.js' */

/** Share of the panel that the points may fill. */
const FILLED = 0.7;

/**
 * The middle of some points, and the scale at which they fill a panel.
 *
 * @param {readonly ImagePoint[]} points image pixels, at least one
 * @param {Size} panel CSS pixels
 * @param {number} most largest scale
 * @returns {{center: ImagePoint, scale: number}}
 */
export function framePoints(points, panel, most) {
	const [xs, ys] = [points.map(({ x }) => x), points.map(({ y }) => y)];
	const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
	const wide = (FILLED * panel.width) / Math.max(right - left, 1);
	const tall = (FILLED * panel.height) / Math.max(bottom - top, 1);
	return { center: { x: (left + right) / 2, y: (top + bottom) / 2 }, scale: Math.min(most, wide, tall) };
}
