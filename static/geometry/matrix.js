// @ts-check
/** Small dense linear algebra: vectors are arrays, matrices arrays of rows. */

/** @typedef {number[]} Vector */
/** @typedef {number[][]} Matrix   rows */

/** @param {Vector} a @param {Vector} b @returns {number} */
export function dot(a, b) {
	let sum = 0;
	for (let i = 0; i < a.length; i++) sum += a[i] * b[i];
	return sum;
}

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export function cross(a, b) {
	return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export function subtract(a, b) {
	return a.map((value, i) => value - b[i]);
}

/** @param {Vector} a @param {number} factor @returns {Vector} */
export function times(a, factor) {
	return a.map((value) => value * factor);
}

/** @param {Vector} a @returns {number} */
export function norm(a) {
	return Math.sqrt(dot(a, a));
}

/** @param {Matrix} A @param {Matrix} B @returns {Matrix} */
export function multiply(A, B) {
	return A.map((row) => B[0].map((_, j) => row.reduce((sum, value, k) => sum + value * B[k][j], 0)));
}

/** @param {Matrix} A @param {Vector} x @returns {Vector} */
export function apply(A, x) {
	return A.map((row) => dot(row, x));
}

/** @param {Matrix} A @returns {Matrix} */
export function transpose(A) {
	return A[0].map((_, j) => A.map((row) => row[j]));
}

const SWEEPS = 60;

/**
 * The unit vector x that makes |A x| smallest: the last right singular vector.
 *
 * One-sided Jacobi (Hestenes): columns are turned against each other until they are orthogonal.
 * It never forms A'A, which would square the condition number and cost half the digits.
 *
 * @param {Matrix} A n rows, m <= n columns
 * @returns {Vector}
 */
export function smallestSingularVector(A) {
	const columns = transpose(A);
	const V = columns.map((_, i) => columns.map((_, j) => (i === j ? 1 : 0)));
	for (let sweep = 0; sweep < SWEEPS; sweep++) {
		if (!sweepColumns(columns, V)) break;
	}
	const lengths = columns.map(norm);
	return V[lengths.indexOf(Math.min(...lengths))];
}

/**
 * Makes each pair of columns orthogonal once; says whether anything had to turn.
 *
 * @param {Matrix} columns @param {Matrix} V @returns {boolean}
 */
function sweepColumns(columns, V) {
	let turned = false;
	for (let p = 0; p < columns.length - 1; p++) {
		for (let q = p + 1; q < columns.length; q++) {
			const alpha = dot(columns[p], columns[p]);
			const beta = dot(columns[q], columns[q]);
			const gamma = dot(columns[p], columns[q]);
			if (Math.abs(gamma) <= 1e-16 * Math.sqrt(alpha * beta)) continue;
			turned = true;
			const zeta = (beta - alpha) / (2 * gamma);
			const t = (zeta < 0 ? -1 : 1) / (Math.abs(zeta) + Math.sqrt(1 + zeta * zeta));
			const cosine = 1 / Math.sqrt(1 + t * t);
			turnPair(columns, p, q, cosine, cosine * t);
			turnPair(V, p, q, cosine, cosine * t);
		}
	}
	return turned;
}

/** @param {Matrix} rows @param {number} p @param {number} q @param {number} c @param {number} s */
function turnPair(rows, p, q, c, s) {
	const first = rows[p];
	const second = rows[q];
	rows[p] = first.map((value, i) => c * value - s * second[i]);
	rows[q] = first.map((value, i) => s * value + c * second[i]);
}
