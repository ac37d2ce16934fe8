// @ts-check
/** Which views wait for lines, and which of some changed lines are as they were proposed. */

import { twinMarking } from './edits.js';

/** @import {GroupDocument, LinesJson, PointJson, ViewJson} from '../api/types.js' */

/** Whether a view has a picture and neither lines nor a given camera. @param {ViewJson} view */
export function isBare({ image, station, lines }) {
	return Boolean(image) && !station.has_given && Object.keys(lines).length === 0;
}

/** @param {GroupDocument} group @returns {ViewJson[]} */
export function bareViews(group) {
	return group.views.filter(isBare);
}

/**
 * The markings whose points are as they were proposed; under their own name or, once the sides
 * were swapped, under that of their twin.
 *
 * @param {Record<string, PointJson[] | null>} changes @param {LinesJson} proposed
 * @returns {string[]}
 */
export function asProposed(changes, proposed) {
	return Object.keys(changes).filter((marking) => (
		[marking, twinMarking(marking)].some((name) => isSame(changes[marking], proposed[name]))
	));
}

/** @param {PointJson[] | null} a @param {PointJson[] | undefined} b */
function isSame(a, b) {
	if (!a?.length || a.length !== b?.length) return false;
	return a.every(({ x, y }, i) => x === b[i].x && y === b[i].y);
}
