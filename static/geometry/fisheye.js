// @ts-check
/**
 * Fisheye: lenses whose image radius is a polynomial of the angle between a ray and the axis.
 *
 * The twin of app/geometry/fisheye.py. `fisheye` has k1 .. k4 (Kannala-Brandt), `arctan_polynomial` a0 .. a8.
 */

/** @typedef {[number, number]} Pair */
/**
 * @typedef {object} Profile image radius by angle
 * @property {number[]} terms of the polynomial, the constant one first
 * @property {number[]} growth terms of its derivative
 * @property {number} inner angle within which the radius is `slope` times the angle
 * @property {number} slope
 * @property {number} widest largest angle that the lens shows, radians
 * @property {number} edge radius there
 */

const WIDEST = Math.PI / 2 - 1e-3;
const INNER = 10;
const GRID = 1e-3;
const STEPS = 60;

/**
 * The profile of a lens by name.
 *
 * @param {string | undefined} lens
 * @param {number[] | null | undefined} coefficients
 * @returns {Profile | null} null for OpenCV's full model, which is no lens of this kind
 */
export function profileOf(lens, coefficients) {
	if (!coefficients) return null;
	if (lens === 'fisheye') {
		const [k1, k2, k3, k4] = coefficients;
		return makeProfile([0, 1, 0, k1, 0, k2, 0, k3, 0, k4]);
	}
	return lens === 'arctan_polynomial' ? makeProfile(coefficients) : null;
}

/** @param {number[]} terms @returns {Profile} */
function makeProfile(terms) {
	const growth = terms.map((term, power) => power * term).slice(1);
	const inner = (INNER * Math.abs(terms[0])) / terms[1];
	const widest = widestAngle(growth, inner);
	const slope = inner > 0 ? value(terms, inner) / inner : terms[1];
	return { terms, growth, inner, slope, widest, edge: value(terms, widest) };
}

/** Where the radius stops growing. @param {number[]} growth @param {number} inner */
function widestAngle(growth, inner) {
	const count = Math.ceil((WIDEST - inner) / GRID);
	for (let i = 0; i <= count; i++) {
		const angle = i < count ? inner + i * GRID : WIDEST;
		if (value(growth, angle) > 0) continue;
		let [low, high] = [Math.max(inner, inner + (i - 1) * GRID), angle];
		for (let step = 0; step < STEPS; step++) {
			const middle = (low + high) / 2;
			if (value(growth, middle) > 0) low = middle;
			else high = middle;
		}
		return low;
	}
	return WIDEST;
}

/** @param {number[]} terms @param {number} at */
function value(terms, at) {
	return terms.reduceRight((total, term) => total * at + term, 0);
}

/** @param {Profile} profile @param {number} angle */
function radiusAt(profile, angle) {
	return angle < profile.inner ? profile.slope * angle : value(profile.terms, angle);
}

/** @param {Profile} profile @param {number} angle */
function growthAt(profile, angle) {
	return angle < profile.inner ? profile.slope : value(profile.growth, angle);
}

/**
 * Distorted normalised coordinates of an ideal point.
 *
 * @param {Pair} point @param {Profile} profile
 * @returns {Pair | null} null beyond the edge of what the lens shows
 */
export function bend([x, y], profile) {
	const ideal = Math.hypot(x, y);
	const angle = Math.atan(ideal);
	if (!(angle <= profile.widest)) return null;
	const ratio = ideal > 0 ? radiusAt(profile, angle) / ideal : profile.slope;
	return [x * ratio, y * ratio];
}

/**
 * Derivative of `bend` by the ideal coordinates: [du/dx, du/dy, dv/dx, dv/dy].
 *
 * @param {Pair} point @param {Profile} profile
 * @returns {[number, number, number, number]}
 */
export function bendJacobian([x, y], profile) {
	const ideal = Math.hypot(x, y);
	const angle = Math.atan(ideal);
	const across = ideal > 0 ? radiusAt(profile, angle) / ideal : profile.slope;
	const more = growthAt(profile, angle) / (1 + ideal * ideal) - across;
	const [ex, ey] = ideal > 0 ? [x / ideal, y / ideal] : [0, 0];
	return [across + more * ex * ex, more * ex * ey, more * ex * ey, across + more * ey * ey];
}

/**
 * Ideal normalised coordinates of a distorted point: Newton's method, halving wherever a step would leave the interval.
 *
 * @param {Pair} point @param {Profile} profile
 * @returns {Pair | null} null beyond the edge of what the lens shows
 */
export function unbend([u, v], profile) {
	const radius = Math.hypot(u, v);
	if (!(radius <= profile.edge)) return null;
	if (radius === 0) return [0, 0];
	let [low, high] = [0, profile.widest];
	let angle = Math.min(high, radius / profile.slope);
	for (let step = 0; step < STEPS; step++) {
		const error = radiusAt(profile, angle) - radius;
		if (error === 0) break;
		if (error < 0) low = angle;
		else high = angle;
		let moved = angle - error / growthAt(profile, angle);
		if (!(moved >= low && moved <= high)) moved = (low + high) / 2;
		const settled = Math.abs(moved - angle) <= 4e-16 * angle;
		angle = moved;
		if (settled) break;
	}
	const ratio = Math.tan(angle) / radius;
	return [u * ratio, v * ratio];
}
