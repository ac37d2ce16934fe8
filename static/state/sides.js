// @ts-check
/** Swapping left and right: which view a finding names, and what speaks against turning another one. */

import { openFindings } from './open_findings.js';

/** @import {GroupDocument, SolutionJson, ViewJson} from '../api/types.js' */

/** Keys of the views whose sides a finding calls swapped. @param {SolutionJson | null} solution @returns {string[]} */
export function swappedViews(solution) {
	return openFindings(solution).flatMap(({ kind, view }) => (kind === 'sides_swapped' && view ? [view] : []));
}

/** How far a view's camera stands to the near side, metres; null without a camera. @param {SolutionJson | null} solution @param {ViewJson} view */
function nearness(solution, view) {
	return solution?.views.find((one) => one.view === view.key)?.calibration.camera?.position_meters[1] ?? null;
}

/**
 * What speaks against swapping left and right in a view, which sends its camera across the pitch; null: nothing.
 *
 * @param {GroupDocument} group @param {SolutionJson | null} solution @param {ViewJson} view
 * @returns {string | null}
 */
export function swapWarning(group, solution, view) {
	const here = nearness(solution, view);
	// Back to the near side is where broadcast cameras stand.
	if (here === null || here <= 0 || swappedViews(solution).includes(view.key)) return null;
	if (view === group.views[0]) return `${view.letter} is the main camera: the swap would move it to the other side of the pitch, where no main camera stands.`;
	const beyond = group.views.filter((other) => other.key !== view.key && (nearness(solution, other) ?? 0) < 0);
	if (beyond.length === 0) return null;
	return `After the swap, two cameras, ${[...beyond, view].map(({ letter }) => letter).join(' and ')}, would stand on the far side of the pitch.`;
}
