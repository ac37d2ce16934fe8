// @ts-check
/** Points carried onto the paint that was seen of their marking. */

/** @import {ImagePoint} from './viewport.js' */

/** @typedef {readonly (readonly [number, number, number])[]} Places of one marking, in their order: x, y, sigma */

/** How far from its paint a point is taken along, as a share of the picture's width. */
const REACH = 1 / 80;
/** Farther apart than so many times the reach two places are not one piece of paint. */
const GAP = 3;

/** @param {number} width of the picture, pixels @returns {number} pixels */
export function reachOf(width) {
	return width * REACH;
}

/**
 * The nearest place on the paint of a marking.
 *
 * @param {ImagePoint} point @param {Places | undefined} places @param {number} reach pixels
 * @returns {ImagePoint | null} null where there is no paint within reach
 */
export function ontoPaint(point, places, reach) {
	let best = reach;
	/** @type {ImagePoint | null} */
	let found = null;
	(places ?? []).forEach(([x, y], i) => {
		const [fromX, fromY] = i > 0 ? places?.[i - 1] ?? [x, y] : [x, y];
		const isPiece = Math.hypot(x - fromX, y - fromY) <= GAP * reach;
		const near = isPiece ? nearestOn(point, fromX, fromY, x, y) : { x, y };
		const apart = Math.hypot(near.x - point.x, near.y - point.y);
		if (apart > best) return;
		best = apart;
		found = near;
	});
	return found;
}

/** A goal is no paint on grass. @param {string} marking */
function isPainted(marking) {
	return !marking.startsWith('Goal');
}

/** @param {ImagePoint} point @param {number} ax @param {number} ay @param {number} bx @param {number} by @returns {ImagePoint} */
function nearestOn(point, ax, ay, bx, by) {
	const [dx, dy] = [bx - ax, by - ay];
	const length = dx * dx + dy * dy;
	const share = length ? Math.min(1, Math.max(0, ((point.x - ax) * dx + (point.y - ay) * dy) / length)) : 0;
	return { x: ax + share * dx, y: ay + share * dy };
}

/**
 * Lines with their points on the paint; those without paint within reach stay.
 *
 * @param {import('../api/types.js').LinesJson} lines @param {Record<string, Places>} paint @param {number} reach
 * @param {string | null} [only] of this marking alone
 * @returns {{lines: import('../api/types.js').LinesJson, moved: number[], left: number}} how far each point moved that did, and how many stayed
 */
export function linesOntoPaint(lines, paint, reach, only = null) {
	/** @type {number[]} */
	const moved = [];
	let left = 0;
	const next = Object.fromEntries(Object.entries(lines).map(([marking, points]) => {
		if (!isPainted(marking) || (only !== null && marking !== only)) return [marking, points];
		return [marking, points.map((point) => {
			const to = ontoPaint(point, paint[marking], reach);
			if (!to) {
				left += 1;
				return point;
			}
			moved.push(Math.hypot(to.x - point.x, to.y - point.y));
			return to;
		})];
	}));
	return { lines: next, moved, left };
}
