// @ts-check
/** Staged edits: steps away from what is saved, taken back and made again before anything is sent. */

import { stored } from '../lib/storage.js';
import { changesBetween, sameLines } from './line_changes.js';

/** @import {GroupDocument, LinesJson, PointJson} from '../api/types.js' */
/** @import {LinesEdit} from './edits.js' */

/** @typedef {{readonly lines: LinesJson, readonly label: string, readonly run: string}} Step */
/**
 * @typedef {object} Staging
 * @property {LinesJson} base what is saved
 * @property {Step[]} steps what was done, also what was taken back since
 * @property {number} at how many steps are in force
 */

/** Staged edits by station; they survive a reload of the tab. */
export const stagings = stored('staged-lines', /** @type {Record<string, Staging>} */ ({}), 'sessionStorage');

/** The markings of a group that are staged and not saved, and the first view that has some. @param {GroupDocument} group */
export function stagedIn({ views }) {
	const staged = views.flatMap(({ key, station, lines }, at) => {
		const isFirst = views.findIndex((view) => view.station.id === station.id) === at;
		const kept = isFirst ? stagings.value[station.id] : undefined;
		return kept ? Object.keys(changesOf(rebase(kept, lines))).map(() => key) : [];
	});
	return { count: staged.length, view: staged.at(0) };
}

/** @param {LinesJson} base @returns {Staging} */
export function begin(base) {
	return { base, steps: [], at: 0 };
}

/** The lines with every step in force. @param {Staging} staging @returns {LinesJson} */
export function linesOf({ base, steps, at }) {
	return at > 0 ? steps[at - 1].lines : base;
}

/**
 * One step more; steps that were taken back are gone.
 *
 * @param {Staging} staging @param {LinesJson} lines @param {string} label
 * @param {string} [run] steps of the same run, such as nudges of one point, are one step
 * @returns {Staging}
 */
export function stage(staging, lines, label, run = '') {
	if (sameLines(linesOf(staging), lines)) return staging;
	const kept = staging.steps.slice(0, staging.at);
	if (run && kept.at(-1)?.run === run) kept.pop();
	return { base: staging.base, steps: [...kept, { lines, label, run }], at: kept.length + 1 };
}

/** @param {Staging} staging @returns {Staging} */
export function stepBack(staging) {
	return { ...staging, at: Math.max(0, staging.at - 1) };
}

/** @param {Staging} staging @returns {Staging} */
export function stepForward(staging) {
	return { ...staging, at: Math.min(staging.steps.length, staging.at + 1) };
}

/** What would be sent. @param {Staging} staging @returns {Record<string, PointJson[] | null>} */
export function changesOf(staging) {
	return changesBetween(staging.base, linesOf(staging));
}

/** Run of the step that stages proposed lines. */
export const PROPOSED = 'proposed';

/** The lines as they were proposed, where a step in force has staged such. @param {Staging} staging @returns {LinesJson} */
export function proposedLines({ base, steps, at }) {
	const last = steps.slice(0, at).findLastIndex(({ run }) => run === PROPOSED);
	if (last < 0) return {};
	const before = last > 0 ? steps[last - 1].lines : base;
	return Object.fromEntries(Object.entries(steps[last].lines).filter(([marking]) => !(marking in before)));
}

/**
 * The same changes on top of what somebody else has saved meanwhile. Markings that were not
 * changed here are theirs.
 *
 * @param {Staging} staging @param {LinesJson} base
 * @returns {Staging}
 */
export function rebase(staging, base) {
	if (sameLines(staging.base, base)) return staging;
	return stage(begin(base), withChanges(base, Object.entries(changesOf(staging))), 'Your staged changes, on top of theirs');
}

/** The markings that both staged edits and a newer saved state change, to something else. @param {Staging} staging @param {LinesJson} newer @returns {string[]} */
export function overlapOf(staging, newer) {
	const theirs = changesBetween(staging.base, newer);
	const apart = changesBetween(newer, linesOf(staging));
	return Object.keys(changesOf(staging)).filter((marking) => marking in theirs && marking in apart);
}

/** @param {LinesJson} lines @param {[string, PointJson[] | null][]} changes new points by marking; null: it goes @returns {LinesJson} */
function withChanges(lines, changes) {
	const next = { ...lines };
	for (const [marking, points] of changes) {
		if (points) next[marking] = points;
		else delete next[marking];
	}
	return next;
}

/** What an edit says of lines as staged steps; what it has as proposed stays so. @param {Staging} staging @param {LinesEdit} edit @param {string} label @returns {Staging} */
export function stageEdit(staging, { lines, proposed = [] }, label) {
	const changes = Object.entries(lines);
	const drawn = changes.filter(([marking]) => !proposed.includes(marking));
	const before = stage(staging, withChanges(linesOf(staging), drawn), label);
	return stage(before, withChanges(linesOf(before), changes), label, PROPOSED);
}
