// @ts-check
/** Which views wait for lines, what is proposed for those on screen, and which changed lines are as they were proposed. */

import { signal } from '@preact/signals';

import { fixed, sharePercent } from '../lib/format.js';
import { twinMarking } from './edits.js';

/** @import {ViewProposalJson} from '../api/proposals.js' */
/** @import {CalibrationJson, GroupDocument, LinesJson, PointJson, SolutionJson, ViewJson} from '../api/types.js' */

/** What is proposed for the views of the group on screen, by key; filled once the code that asks is there. */
export const openProposals = signal(/** @type {ReadonlyMap<string, ViewProposalJson>} */ (new Map()));

/** Views whose picture is being looked at for lines to propose, by id. */
export const lookedAt = signal(/** @type {ReadonlySet<number>} */ (new Set()));

/** State of the group on screen for which that is known, or known to be unknown: the server is away, or refuses. */
export const settledState = signal('');

/** @param {GroupDocument} group */
export function stateOf({ id, etag }) {
	return `${id} ${etag}`;
}

/** Whether lines determine no camera: none was found, or one that they leave open. @param {CalibrationJson | null | undefined} calibration */
export function leavesOpen(calibration) {
	return Boolean(calibration) && (!calibration?.camera || calibration.unobservable.length > 0);
}

/**
 * Whether a view has a picture and no camera, neither a given one nor one of its lines.
 *
 * @param {ViewJson} view @param {SolutionJson | null} solution
 */
export function waitsForLines({ key, image, station, lines }, solution) {
	if (!image || station.has_given) return false;
	return Object.keys(lines).length === 0 || leavesOpen(solution?.views.find(({ view }) => view === key)?.calibration);
}

/** @param {GroupDocument} group @returns {ViewJson[]} */
export function waitingViews(group) {
	return group.views.filter((view) => waitsForLines(view, group.solution));
}

/** Whether none of the markings that are proposed is there already. @param {LinesJson} lines @param {LinesJson} proposed */
export function areNew(lines, proposed) {
	return !Object.keys(proposed).some((marking) => marking in lines);
}

/**
 * Lines with those that are proposed beside them, and which that are: what is drawn stays.
 *
 * @param {LinesJson} lines @param {LinesJson} proposed
 * @returns {{all: LinesJson, added: string[]}}
 */
export function besideDrawn(lines, proposed) {
	return { all: { ...proposed, ...lines }, added: Object.keys(proposed).filter((marking) => !(marking in lines)) };
}

/** The scores of what is proposed, in words. @param {ViewProposalJson} item */
export function scoreWords({ supported, explained, error_px: error }) {
	return [
		supported === null ? '' : `${sharePercent(supported)} of its markings have paint`,
		explained === null ? '' : `${sharePercent(explained)} of the paint has a marking`,
		error === null ? '' : `${fixed(error, 2)} px between them`,
	].filter(Boolean).join(', ').replaceAll(' %', '\u00a0%');
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
