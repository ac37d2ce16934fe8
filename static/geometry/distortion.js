// @ts-check
/**
 * Lens distortion: OpenCV's full model on normalised image coordinates.
 *
 * Coefficients stand in the order k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.
 */

/** @typedef {[number, number]} Pair */

const NEWTON_STEPS = 25;
/** Share of the fold from which a point is sought again that was not found from where it is seen:
 * from beyond the fold Newton's method may run away. */
const AGAIN_AT = 0.6;

/**
 * Distorted normalised coordinates of an ideal point.
 *
 * @param {Pair} point
 * @param {number[]} coefficients 12 numbers
 * @returns {Pair}
 */
export function distort([x, y], coefficients) {
	const [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = coefficients;
	const r2 = x * x + y * y;
	const r4 = r2 * r2;
	const radial =
		(1 + k1 * r2 + k2 * r4 + k3 * r4 * r2) / (1 + k4 * r2 + k5 * r4 + k6 * r4 * r2);
	return [
		x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + s1 * r2 + s2 * r4,
		y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + s3 * r2 + s4 * r4,
	];
}

/**
 * Derivative of `distort` by the ideal coordinates: [dx/dx, dx/dy, dy/dx, dy/dy].
 *
 * @param {Pair} point
 * @param {number[]} coefficients
 * @returns {[number, number, number, number]}
 */
function distortJacobian([x, y], coefficients) {
	const [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = coefficients;
	const r2 = x * x + y * y;
	const r4 = r2 * r2;
	const denominator = 1 + k4 * r2 + k5 * r4 + k6 * r4 * r2;
	const radial = (1 + k1 * r2 + k2 * r4 + k3 * r4 * r2) / denominator;
	// Derivative of the radial factor by r^2.
	const slope =
		(k1 + 2 * k2 * r2 + 3 * k3 * r4 - radial * (k4 + 2 * k5 * r2 + 3 * k6 * r4)) / denominator;
	return [
		radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x + 2 * x * (s1 + 2 * s2 * r2),
		2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * y * (s1 + 2 * s2 * r2),
		2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * x * (s3 + 2 * s4 * r2),
		radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x + 2 * y * (s3 + 2 * s4 * r2),
	];
}

/**
 * Ideal normalised coordinates of a distorted point, by Newton's method on `distort`.
 *
 * @param {Pair} point
 * @param {number[]} coefficients
 * @returns {Pair | null} null where no ideal point maps to it
 */
export function undistort([u, v], coefficients) {
	if (!coefficients.some((value) => value !== 0)) return [u, v];
	const found = searchIdeal([u, v], 1, coefficients);
	if (found) return found;
	const share = AGAIN_AT * foldRadius(coefficients) / Math.hypot(u, v);
	return share < 1 ? searchIdeal([u, v], share, coefficients) : null;
}

/**
 * The ideal point of a distorted one by Newton's method, from a share of the distorted point on.
 *
 * @param {Pair} point
 * @param {number} share
 * @param {number[]} coefficients
 * @returns {Pair | null}
 */
function searchIdeal([u, v], share, coefficients) {
	let x = share * u;
	let y = share * v;
	for (let step = 0; step < NEWTON_STEPS; step++) {
		const [a, b] = distort([x, y], coefficients);
		const errorX = a - u;
		const errorY = b - v;
		if (Math.max(Math.abs(errorX), Math.abs(errorY)) < 1e-15) break;
		const [j00, j01, j10, j11] = distortJacobian([x, y], coefficients);
		const determinant = j00 * j11 - j01 * j10;
		x -= (j11 * errorX - j01 * errorY) / determinant;
		y -= (j00 * errorY - j10 * errorX) / determinant;
	}
	const [a, b] = distort([x, y], coefficients);
	const residual = Math.max(Math.abs(a - u), Math.abs(b - v));
	return residual < 1e-9 && Math.hypot(x, y) <= foldRadius(coefficients) ? [x, y] : null;
}

/**
 * Ideal radius up to which the distorted radius grows; infinite where it always does.
 *
 * Beyond it far points fold back into the picture, so they count as not visible. The radius is
 * searched in small steps up to 5 (79 degrees off the axis) and then bisected, which needs no
 * polynomial roots and is exact enough for what decides over visible or not.
 *
 * @param {number[]} coefficients
 * @returns {number}
 */
export function foldRadius(coefficients) {
	const [k1, k2, , , k3, k4, k5, k6] = coefficients;
	if (k2 === 0 && k3 === 0 && k4 === 0 && k5 === 0 && k6 === 0) {
		return k1 < 0 ? Math.sqrt(-1 / (3 * k1)) : Infinity;
	}
	const radial = [k1, k2, 0, 0, k3, k4, k5, k6, 0, 0, 0, 0];
	// Where the denominator is zero the picture ends too: behind it the radius grows from far on the other side.
	/** @param {number} r */
	const denominator = (r) => 1 + r * r * (k4 + r * r * (k5 + r * r * k6));
	/** @param {number} r */
	const grows = (r) => denominator(r) > 0 && distortJacobian([r, 0], radial)[0] > 0;
	const step = 0.01;
	for (let r = step; r <= 5; r += step) {
		if (grows(r)) continue;
		let [low, high] = [r - step, r];
		for (let i = 0; i < 50; i++) {
			const middle = (low + high) / 2;
			if (grows(middle)) low = middle;
			else high = middle;
		}
		return low;
	}
	return Infinity;
}
