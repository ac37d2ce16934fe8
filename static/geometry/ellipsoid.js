// @ts-check
/** The ellipsoid of a covariance: how far off a 3D point may be, and in which direction. */

import { cross } from './matrix.js';

/** @import {Matrix, Vector} from './matrix.js' */

/**
 * @typedef {object} Ellipsoid
 * @property {Vector[]} axes three unit vectors, the longest half axis first, right-handed
 * @property {Vector} radii half axes in the same order
 */

const SWEEPS = 30;

/**
 * The half axes at `k` standard deviations.
 *
 * @param {(number | null)[]} covariance 3 x 3, row by row
 * @param {number} k
 * @returns {Ellipsoid | null} null when a number is missing or the matrix is no covariance
 */
export function ellipsoidOf(covariance, k) {
	const numbers = covariance.filter((value) => value !== null && Number.isFinite(value));
	if (numbers.length !== 9) return null;
	const C = /** @type {number[]} */ (numbers);
	const { values, vectors } = symmetricEigen([C.slice(0, 3), C.slice(3, 6), C.slice(6, 9)]);
	const order = [0, 1, 2].sort((a, b) => values[b] - values[a]);
	const largest = values[order[0]];
	// A direction may be known almost exactly, but nothing is known better than exactly.
	if (largest <= 0 || values[order[2]] < -1e-9 * largest) return null;
	const [first, second] = order.map((i) => vectors[i]);
	return {
		axes: [first, second, cross(first, second)],
		radii: order.map((i) => k * Math.sqrt(Math.max(0, values[i]))),
	};
}

/**
 * Eigenvalues and unit eigenvectors of a symmetric matrix, by Jacobi's rotations.
 *
 * @param {Matrix} A
 * @returns {{values: Vector, vectors: Vector[]}} `vectors[i]` belongs to `values[i]`
 */
export function symmetricEigen(A) {
	const n = A.length;
	const M = A.map((row) => row.slice());
	const V = A.map((_, i) => A.map((__, j) => (i === j ? 1 : 0)));
	for (let sweep = 0; sweep < SWEEPS; sweep++) {
		for (let p = 0; p < n - 1; p++) {
			for (let q = p + 1; q < n; q++) rotate(M, V, p, q);
		}
	}
	return { values: M.map((row, i) => row[i]), vectors: V };
}

/**
 * Turn rows and columns p and q so that their common entry becomes zero.
 *
 * @param {Matrix} M @param {Matrix} V rows are the eigenvectors so far @param {number} p @param {number} q
 */
function rotate(M, V, p, q) {
	if (M[p][q] === 0) return;
	const theta = (M[q][q] - M[p][p]) / (2 * M[p][q]);
	const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(1, theta));
	const c = 1 / Math.hypot(1, t);
	const s = c * t;
	for (const row of M) turn(row, p, q, c, s);
	for (const rows of [M, V]) {
		const [first, second] = [rows[p], rows[q]];
		rows[p] = first.map((value, i) => c * value - s * second[i]);
		rows[q] = first.map((value, i) => s * value + c * second[i]);
	}
}

/** @param {Vector} row @param {number} p @param {number} q @param {number} c @param {number} s */
function turn(row, p, q, c, s) {
	const first = row[p];
	row[p] = c * first - s * row[q];
	row[q] = s * first + c * row[q];
}
