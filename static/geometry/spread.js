// @ts-check
/** Marks that would cover one another are moved apart; where they belong is kept. */

/** @typedef {{x: number, y: number}} Place */
/** @typedef {{left: number, top: number, right: number, bottom: number}} Box */

const ROUNDS = 300;
const PATIENCE = 40;
/** Radians. */
const SWIRL = 1.2;
/** Marks in the very same place go apart in this direction, radians: a different one for each. */
const TURN = 2.4;

/**
 * Places no two of which are closer than `apart`, each as near to where it was as can be.
 *
 * @param {Place[]} places where the marks belong
 * @param {number} apart least distance of two marks, in the unit of the places
 * @param {Box} box where marks may stand
 * @param {Place[]} [taken] places that marks keep away from as well
 * @returns {Place[]} in the same order
 */
export function spreadApart(places, apart, box, taken = []) {
	const spread = places.map((place) => within(place, box));
	for (let round = 0; round < ROUNDS; round++) {
		let moved = false;
		// What is caught in a corner leaves it sideways.
		const swirl = round < PATIENCE ? 0 : SWIRL;
		for (let i = 0; i < spread.length; i++) {
			for (let j = i + 1; j < spread.length; j++) moved = push(spread[i], spread[j], apart, i + j, 0.5, swirl) || moved;
			for (const b of taken) moved = push(spread[i], { ...b }, apart, i, 1, swirl) || moved;
		}
		if (!moved) break;
		spread.forEach((place) => Object.assign(place, within(place, box)));
	}
	return spread;
}

/** @param {Place} place @param {Box} box @returns {Place} */
export function within({ x, y }, { left, top, right, bottom }) {
	return { x: Math.min(right, Math.max(left, x)), y: Math.min(bottom, Math.max(top, y)) };
}

/** @param {Place} a @param {Place} b @param {number} apart @param {number} turn @param {number} share of the way that a goes @param {number} swirl radians by which they go past each other */
function push(a, b, apart, turn, share, swirl) {
	const distance = Math.hypot(b.x - a.x, b.y - a.y);
	if (distance >= apart - 1e-6) return false;
	const angle = swirl + (distance > 1e-9 ? Math.atan2(b.y - a.y, b.x - a.x) : TURN * turn);
	const [dx, dy] = [Math.cos(angle), Math.sin(angle)];
	// A little more than is needed, so that it comes to an end.
	const way = apart - distance + 1e-3 * apart;
	a.x -= share * way * dx;
	a.y -= share * way * dy;
	b.x += (1 - share) * way * dx;
	b.y += (1 - share) * way * dy;
	return true;
}

/**
 * The part of a segment inside a box.
 *
 * @param {Place} from @param {Place} to @param {Box} box
 * @returns {[Place, Place] | null} null when none of it is inside
 */
export function clipSegment(from, to, { left, top, right, bottom }) {
	let [enter, leave] = [0, 1];
	const [dx, dy] = [to.x - from.x, to.y - from.y];
	for (const [step, room] of [[-dx, from.x - left], [dx, right - from.x], [-dy, from.y - top], [dy, bottom - from.y]]) {
		if (step === 0) {
			if (room < 0) return null;
		} else if (step < 0) {
			enter = Math.max(enter, room / step);
		} else {
			leave = Math.min(leave, room / step);
		}
	}
	if (enter > leave) return null;
	return [
		{ x: from.x + enter * dx, y: from.y + enter * dy },
		{ x: from.x + leave * dx, y: from.y + leave * dy },
	];
}
