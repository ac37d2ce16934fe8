// @ts-check
/** Edits that put points on markings: where a new point belongs between the others. */

/** @import {PointJson, ViewJson} from '../api/types.js' */
/** @import {LinesEdit} from './edits.js' */

/**
 * The place among the points where one more makes the line least longer. A line drawn end to end
 * grows at its ends, and a point beside a stretch goes into that stretch.
 *
 * @param {PointJson[]} points @param {PointJson} to
 * @returns {number} from 0 to the number of points
 */
export function placeFor(points, to) {
	if (points.length < 2) return points.length;
	let best = { index: points.length, longer: apart(points[points.length - 1], to) };
	const atStart = apart(points[0], to);
	if (atStart < best.longer) best = { index: 0, longer: atStart };
	for (let i = 1; i < points.length; i++) {
		const [a, b] = [points[i - 1], points[i]];
		const longer = apart(a, to) + apart(to, b) - apart(a, b);
		if (longer < best.longer) best = { index: i, longer };
	}
	return best.index;
}

/** @param {PointJson} a @param {PointJson} b */
function apart(a, b) {
	return Math.hypot(a.x - b.x, a.y - b.y);
}

/**
 * A line edit with one point more, on a marking that exists or on a new one.
 *
 * @param {ViewJson} view @param {string} marking @param {PointJson} to
 * @returns {{edit: LinesEdit, index: number}} where the new point stands
 */
export function addPoint(view, marking, to) {
	const points = view.lines[marking] ?? [];
	const index = placeFor(points, to);
	const next = [...points.slice(0, index), to, ...points.slice(index)];
	return { edit: { kind: 'lines', view: view.key, lines: { [marking]: next } }, index };
}

/**
 * The marking under a place, and the place on its annotated line.
 *
 * @param {ViewJson} view @param {PointJson} at @param {number} reach image pixels
 * @returns {string | null}
 */
export function markingAt(view, at, reach) {
	let best = { marking: /** @type {string | null} */ (null), distance: reach };
	for (const [marking, points] of Object.entries(view.lines)) {
		for (let i = 1; i < points.length; i++) {
			const distance = toSegment(points[i - 1], points[i], at);
			if (distance < best.distance) best = { marking, distance };
		}
	}
	return best.marking;
}

/** @param {PointJson} a @param {PointJson} b @param {PointJson} to */
function toSegment(a, b, to) {
	const [dx, dy] = [b.x - a.x, b.y - a.y];
	const squared = dx * dx + dy * dy;
	const along = squared === 0 ? 0 : ((to.x - a.x) * dx + (to.y - a.y) * dy) / squared;
	const t = Math.min(1, Math.max(0, along));
	return Math.hypot(a.x + t * dx - to.x, a.y + t * dy - to.y);
}
