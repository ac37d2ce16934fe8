// @ts-check
/** What lies under the pointer in the editor: a point, else the line of a marking. */

import { nearestOn, piecesOf } from '../../geometry/polyline.js';
import { toScreen } from '../../geometry/viewport.js';

/** @import {LinesJson, PointJson} from '../../api/types.js' */
/** @import {MarkingResiduals} from '../../geometry/residual.js' */
/** @import {ScreenPoint, Size, Viewport} from '../../geometry/viewport.js' */
/** @import {Choice} from '../../state/calibration.js' */

const POINT_REACH = 11;
const LINE_REACH = 7;

/**
 * The point nearest to a place; of the marking in hand first.
 *
 * @param {LinesJson} lines @param {Viewport} viewport @param {ScreenPoint} at @param {string | null} preferred
 * @returns {{marking: string, index: number} | null}
 */
function pointAt(lines, viewport, at, preferred) {
	let best = { found: /** @type {{marking: string, index: number} | null} */ (null), distance: POINT_REACH };
	for (const [marking, points] of Object.entries(lines)) {
		points.forEach((point, index) => {
			const place = toScreen(viewport, point);
			// Corners are drawn twice: as the end of either line.
			const head = marking === preferred ? 4 : 0;
			const distance = Math.hypot(place.x - at.x, place.y - at.y) - head;
			if (distance < best.distance) best = { found: { marking, index }, distance };
		});
	}
	return best.found;
}

/**
 * The marking whose annotated or projected line runs under a place.
 *
 * @param {LinesJson} lines @param {MarkingResiduals[]} fits @param {Viewport} viewport @param {ScreenPoint} at
 * @param {Size} size of the image
 * @returns {string | null}
 */
function lineAt(lines, fits, viewport, at, size) {
	let best = { marking: /** @type {string | null} */ (null), distance: LINE_REACH };
	/** @param {string} marking @param {PointJson[]} polyline */
	const consider = (marking, polyline) => {
		if (polyline.length < 2) return;
		const near = nearestOn(polyline.map((point) => toScreen(viewport, point)), at);
		if (near && near.distance < best.distance) best = { marking, distance: near.distance };
	};
	for (const [marking, points] of Object.entries(lines)) consider(marking, points);
	for (const { marking, polyline } of fits) {
		for (const piece of piecesOf(polyline, size)) consider(marking, piece);
	}
	return best.marking;
}

/** What the pointer finds. @param {LinesJson} lines @param {MarkingResiduals[]} fits @param {Viewport} viewport @param {ScreenPoint} at @param {string | null} preferred @param {Size} size of the image @returns {Choice | null} */
export function choiceAt(lines, fits, viewport, at, preferred, size) {
	const point = pointAt(lines, viewport, at, preferred);
	if (point) return point;
	const marking = lineAt(lines, fits, viewport, at, size);
	return marking ? { marking, index: null } : null;
}
