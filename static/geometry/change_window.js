// @ts-check
/** Which part of a picture shows what was changed in it. */

/** @import {BallJson, LinesJson, PointJson} from '../api/types.js' */
/** @import {ChangedView, PastView} from '../api/history.js' */

/** Of the picture's width: a crop is no narrower, so that one sees where it is. */
const NARROWEST = 0.14;
/** Of the change's own size, on each side. */
const ROOM = 0.35;
const ASPECT = 16 / 9;

/** Markings whose points differ. @param {PastView | null} before @param {PastView | null} after @returns {string[]} */
export function changedMarkings(before, after) {
	const names = new Set([...Object.keys(before?.lines ?? {}), ...Object.keys(after?.lines ?? {})]);
	return [...names].filter((name) => JSON.stringify(before?.lines[name]) !== JSON.stringify(after?.lines[name]));
}

/** Whether the balls differ. @param {PastView | null} before @param {PastView | null} after */
export function ballsChanged(before, after) {
	return JSON.stringify(before?.balls ?? []) !== JSON.stringify(after?.balls ?? []);
}

/** The corners of a ball. @param {BallJson} ball @returns {PointJson[]} */
function corners({ box, point }) {
	if (box) return [{ x: box[0], y: box[1] }, { x: box[0] + box[2], y: box[1] + box[3] }];
	return point ? [{ x: point[0], y: point[1] }] : [];
}

/** Points that differ between two lists, from both. @param {PointJson[]} old @param {PointJson[]} fresh */
function differing(old, fresh) {
	const key = (/** @type {PointJson} */ point) => `${point.x} ${point.y}`;
	const [was, is] = [new Set(old.map(key)), new Set(fresh.map(key))];
	return [...old.filter((point) => !is.has(key(point))), ...fresh.filter((point) => !was.has(key(point)))];
}

/** Every point of a view that is not what it was, before and after. @param {ChangedView} view @returns {PointJson[]} */
function changedPoints({ before, after }) {
	const lines = (/** @type {PastView | null} */ state, /** @type {string} */ name) => /** @type {LinesJson} */ (state?.lines ?? {})[name] ?? [];
	const points = changedMarkings(before, after).flatMap((name) => differing(lines(before, name), lines(after, name)));
	const balls = ballsChanged(before, after) ? [before, after].flatMap((state) => (state?.balls ?? []).flatMap(corners)) : [];
	return [...points, ...balls];
}

/**
 * The part of a view around what was changed, of 16:9, within the picture where it fits; the whole view where nothing in it moved.
 *
 * @param {ChangedView} view
 * @returns {{x: number, y: number, width: number, height: number}} image pixels
 */
export function changeWindow(view) {
	const points = changedPoints(view);
	if (points.length === 0 || view.before === null) return { x: 0, y: 0, width: view.width, height: view.height };
	const [xs, ys] = [points.map(({ x }) => x), points.map(({ y }) => y)];
	const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
	const wide = Math.max((right - left) * (1 + 2 * ROOM), (bottom - top) * (1 + 2 * ROOM) * ASPECT, view.width * NARROWEST);
	const width = Math.min(wide, view.width);
	const height = Math.min(width / ASPECT, view.height);
	const within = (/** @type {number} */ middle, /** @type {number} */ size, /** @type {number} */ all) => Math.max(0, Math.min(all - size, middle - size / 2));
	return { x: within((left + right) / 2, width, view.width), y: within((top + bottom) / 2, height, view.height), width, height };
}
