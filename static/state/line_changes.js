// @ts-check
/** Changes of a view's lines as pure functions: lines in, lines out; what did not change is shared. */

import { twinMarking } from './edits.js';
import { placeFor } from './line_edits.js';

/** @import {LinesJson, PointJson} from '../api/types.js' */

/** @param {LinesJson} lines @param {string} marking @param {PointJson[]} points @returns {LinesJson} */
function put(lines, marking, points) {
	if (points.length > 0) return { ...lines, [marking]: points };
	const { [marking]: _, ...rest } = lines;
	return rest;
}

/** @param {LinesJson} lines @param {string} marking @param {number} index @param {PointJson} to @returns {LinesJson} */
export function withPoint(lines, marking, index, to) {
	return put(lines, marking, (lines[marking] ?? []).map((point, i) => (i === index ? to : point)));
}

/** A marking without points goes. @param {LinesJson} lines @param {string} marking @param {number} index @returns {LinesJson} */
export function withoutPoint(lines, marking, index) {
	return put(lines, marking, (lines[marking] ?? []).filter((_, i) => i !== index));
}

/** @param {LinesJson} lines @param {string} marking @param {number} index place of the new point @param {PointJson} point @returns {LinesJson} */
export function withInserted(lines, marking, index, point) {
	const points = lines[marking] ?? [];
	return put(lines, marking, [...points.slice(0, index), point, ...points.slice(index)]);
}

/**
 * One point more, where it makes the line least longer.
 *
 * @param {LinesJson} lines @param {string} marking @param {PointJson} point
 * @returns {{lines: LinesJson, index: number}}
 */
export function withAdded(lines, marking, point) {
	const index = placeFor(lines[marking] ?? [], point);
	return { lines: withInserted(lines, marking, index, point), index };
}

/** @param {LinesJson} lines @param {string} marking @returns {LinesJson} */
export function withoutMarking(lines, marking) {
	return put(lines, marking, []);
}

/**
 * The points of one marking under another name; they join the points that are there.
 *
 * @param {LinesJson} lines @param {string} from @param {string} to
 * @returns {LinesJson}
 */
export function relabelled(lines, from, to) {
	if (from === to || !lines[from]) return lines;
	return put(withoutMarking(lines, from), to, [...(lines[to] ?? []), ...lines[from]]);
}

/** Every marking under the name that it has from the other side. @param {LinesJson} lines @returns {LinesJson} */
export function sidesSwapped(lines) {
	return Object.fromEntries(Object.entries(lines).map(([marking, points]) => [twinMarking(marking), points]));
}

/**
 * What leads from one state of the lines to another: new points, or null for a marking that goes.
 *
 * @param {LinesJson} from @param {LinesJson} to
 * @returns {Record<string, PointJson[] | null>}
 */
export function changesBetween(from, to) {
	/** @type {Record<string, PointJson[] | null>} */
	const changes = {};
	for (const marking of Object.keys(from)) if (!to[marking]) changes[marking] = null;
	for (const [marking, points] of Object.entries(to)) {
		if (!samePoints(from[marking], points)) changes[marking] = points;
	}
	return changes;
}

/** @param {PointJson[] | undefined} a @param {PointJson[]} b */
function samePoints(a, b) {
	if (a === b) return true;
	return a?.length === b.length && a.every(({ x, y }, i) => x === b[i].x && y === b[i].y);
}

/** @param {LinesJson} a @param {LinesJson} b */
export function sameLines(a, b) {
	return Object.keys(changesBetween(a, b)).length === 0;
}
