// @ts-check
/** The pitch and its markings in the pitch frame: metres, z down (docs/coordinates.md). */

/** @import {PitchPoint} from './camera.js' */

const PENALTY_AREA = { depth: 16.5, width: 40.32 };
const GOAL_AREA = { depth: 5.5, width: 18.32 };
const PENALTY_MARK = 11;
const RADIUS = 9.15;
const GOAL = { width: 7.32, height: 2.44 };

/**
 * Every marking as a polyline.
 *
 * @param {number} length metres @param {number} width metres
 * @returns {Map<string, PitchPoint[]>}
 */
export function pitchMarkings(length, width) {
	const [l, w] = [length / 2, width / 2];
	/** @type {Map<string, PitchPoint[]>} */
	const markings = new Map([
		['Side line top', [[-l, -w, 0], [l, -w, 0]]],
		['Side line bottom', [[-l, w, 0], [l, w, 0]]],
		['Side line left', [[-l, -w, 0], [-l, w, 0]]],
		['Side line right', [[l, -w, 0], [l, w, 0]]],
		['Middle line', [[0, -w, 0], [0, w, 0]]],
		['Circle central', arc(0, 0, 2 * Math.PI)],
	]);
	for (const [side, sign] of /** @type {[string, number][]} */ ([['left', -1], ['right', 1]])) {
		addEnd(markings, side, sign, l);
	}
	return markings;
}

/** The data of an SVG path along points of the pitch, seen from above, one unit a metre. @param {readonly (readonly number[])[]} points */
export function pathFromAbove(points) {
	return `M${points.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join('L')}`;
}

/**
 * @param {Map<string, PitchPoint[]>} markings @param {string} side @param {number} sign
 * @param {number} half half the length of the pitch
 */
function addEnd(markings, side, sign, half) {
	const goalLine = sign * half;
	for (const [name, area] of /** @type {[string, typeof GOAL_AREA][]} */ ([
		['Big rect.', PENALTY_AREA], ['Small rect.', GOAL_AREA],
	])) {
		const front = goalLine - sign * area.depth;
		const y = area.width / 2;
		markings.set(`${name} ${side} top`, [[goalLine, -y, 0], [front, -y, 0]]);
		markings.set(`${name} ${side} bottom`, [[goalLine, y, 0], [front, y, 0]]);
		markings.set(`${name} ${side} main`, [[front, -y, 0], [front, y, 0]]);
	}
	// The penalty arc is what lies outside the penalty area.
	const opening = Math.acos((PENALTY_AREA.depth - PENALTY_MARK) / RADIUS);
	const facing = sign < 0 ? 0 : Math.PI;
	markings.set(
		`Circle ${side}`, arc(goalLine - sign * PENALTY_MARK, facing - opening, facing + opening),
	);
	// Posts are named as seen from the pitch.
	const [left, right] = [(-sign * GOAL.width) / 2, (sign * GOAL.width) / 2];
	const top = -GOAL.height;
	markings.set(`Goal ${side} crossbar`, [[goalLine, left, top], [goalLine, right, top]]);
	markings.set(`Goal ${side} post left`, [[goalLine, left, top], [goalLine, left, 0]]);
	markings.set(`Goal ${side} post right`, [[goalLine, right, top], [goalLine, right, 0]]);
}

/** @param {number} x @param {number} first @param {number} last @returns {PitchPoint[]} */
function arc(x, first, last) {
	const count = 48;
	return Array.from({ length: count + 1 }, (_, i) => {
		const angle = first + ((last - first) * i) / count;
		return [x + RADIUS * Math.cos(angle), RADIUS * Math.sin(angle), 0];
	});
}
