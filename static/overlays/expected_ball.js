// @ts-check
/** Where a view without a ball should show the 3D ball: outline, cross, and how far off that may be. */

import { ballOf } from '../geometry/preview.js';
import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { label, strokeCross, strokeLine, widthOf } from './pen.js';

/** @import {ViewSolutionJson} from '../api/types.js' */
/** @import {Scene} from './scene.js' */

/** The ellipse holds the ball in 95 of 100 cases: as many standard deviations in two dimensions. */
const SIGMAS = 2.45;
const CORNERS = 48;
/** The smallest cross and ellipse, CSS pixels. */
const LEAST = 9;
const ROOMY = 300;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawExpected(context, { picture, viewport }) {
	const expected = picture.solved?.expected;
	if (!expected || ballOf(picture.view) || picture.view.balls.length > 0) return;
	const [x, y] = expected.place;
	const stroke = { colour: colours.value.reprojected, width: 1.5, halo: true };
	strokeLine(context, viewport, picture.outline, { ...stroke, closed: true });
	strokeLine(context, viewport, ellipse(expected), { ...stroke, dash: [3, 4], closed: true });
	const at = toScreen(viewport, { x, y });
	const radius = Math.max(LEAST, ((expected.box?.[2] ?? 0) * viewport.scale) / 2 + 3);
	strokeCross(context, at, radius, radius + 10, stroke);
	if (widthOf(context) >= ROOMY) label(context, 'expected here', { x: at.x + radius + 14, y: at.y - radius - 8 }, colours.value.reprojected);
}

/**
 * The border of where the ball may be seen.
 *
 * @param {NonNullable<ViewSolutionJson['expected']>} expected
 * @returns {{x: number, y: number}[]} image pixels; none where the uncertainty is not known
 */
function ellipse({ place: [x, y], covariance }) {
	const [a, b, , d] = covariance.map((value) => value ?? NaN);
	// Cholesky: the unit circle becomes the ellipse.
	const l11 = Math.sqrt(a);
	const l21 = b / l11;
	const l22 = Math.sqrt(Math.max(0, d - l21 * l21));
	if (!(l11 > 0) || !Number.isFinite(l21 + l22)) return [];
	return Array.from({ length: CORNERS }, (_, i) => {
		const angle = (2 * Math.PI * i) / CORNERS;
		const [u, v] = [SIGMAS * Math.cos(angle), SIGMAS * Math.sin(angle)];
		return { x: x + l11 * u, y: y + l21 * u + l22 * v };
	});
}
