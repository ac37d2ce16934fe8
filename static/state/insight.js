// @ts-check
/**
 * What the server can say about a group beyond its solution: what would make it pass, and how
 * much each marking matters. Asked for once a person stays with a group, and kept for its state.
 */

import { effect, signal, untracked } from '@preact/signals';

import { request } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { Kept } from '../lib/kept.js';
import { groupDocument, isPreview } from './group.js';
import { focused } from './workspace.js';

/** @import {FixJson, GroupDocument, GuideJson, OfferJson} from '../api/types.js' */

/**
 * @typedef {object} Remedy
 * @property {string} gate
 * @property {string | null} view
 * @property {string} sentence
 * @property {FixJson} edit what it is about
 * @property {OfferJson[]} offers edits that carry it out; none where a person has to look or draw
 * @property {GuideJson | null} guide where that person is led
 * @property {number | null} value of the gate with the edit
 * @property {boolean} passes whether the whole group would pass
 */
/**
 * @typedef {object} Influence what the view would be without a marking
 * @property {string} marking
 * @property {Record<string, number>} jac
 * @property {Record<string, number> | null} jac_without
 * @property {number | null} largest_px
 * @property {number | null} largest_px_without
 */
/** @template T @typedef {{key: string, id: number, items: T[]}} Known   id: of the group or view; key: of its state */

/** Whether the solver is still trying out what would correct the group on screen. */
export const isSearching = signal(false);

/** People who go through easy groups stay shorter than this. */
const STAY = 350;

/** What would make the group on screen pass; null until it is known. */
export const remedies = signal(/** @type {Known<Remedy> | null} */ (null));
/** How much each marking of the focused view matters; null until it is known. */
export const influence = signal(/** @type {Known<Influence> | null} */ (null));

/** @type {Kept<string, Known<any>>} */
const kept = new Kept(40);
const PATHS = {
	remedies: (/** @type {number} */ group) => `/groups/${group}/suggestions`,
	influence: (/** @type {number} */ view) => `/views/${view}/influence`,
};
/** Addresses that this server does not have. @type {Set<string>} */
const absent = new Set();

/** @param {'remedies' | 'influence'} what @param {number} id @param {string} etag of the group */
function keyOf(what, id, etag) {
	return `${what} ${id} ${etag}`;
}

/**
 * @param {'remedies' | 'influence'} what @param {number} id @param {string} key @param {AbortSignal} signal
 * @returns {Promise<Known<any> | null>}
 */
async function ask(what, id, key, signal) {
	const present = kept.get(key);
	if (present || absent.has(what)) return present ?? null;
	try {
		const found = { key, id, items: (await request(PATHS[what](id), { signal })).items };
		kept.set(key, found);
		return found;
	} catch (error) {
		if (signal.aborted) return null;
		if (!(error instanceof ApiError)) throw error;
		// 404 is about this group or view, which may have gone.
		if (error.status === 405) absent.add(what);
		return null;
	}
}

/** Whether a person would want to know what to do about it. @param {GroupDocument} group */
function needsHelp({ solution }) {
	return solution !== null && (!solution.passes || solution.views.some(({ failed }) => failed !== null));
}

/**
 * Ask after a while, unless the group has changed by then.
 *
 * @template T
 * @param {'remedies' | 'influence'} what @param {number} id @param {string} etag
 * @param {import('@preact/signals').Signal<Known<T> | null>} into
 * @param {() => void} [answered] called when the answer is there, or that there is none
 */
function askLater(what, id, etag, into, answered) {
	const key = keyOf(what, id, etag);
	const controller = new AbortController();
	if (into.value?.key !== key) into.value = kept.get(key) ?? null;
	const timer = setTimeout(async () => {
		const found = await ask(what, id, key, controller.signal);
		if (controller.signal.aborted) return;
		if (found) into.value = found;
		answered?.();
	}, STAY);
	return () => {
		clearTimeout(timer);
		controller.abort();
	};
}

/** Follow the group and the view that the person looks at. */
export function startInsight() {
	effect(() => {
		const at = groupDocument.value;
		if (!at || isPreview.value || !needsHelp(at)) {
			remedies.value = null;
			isSearching.value = false;
			return undefined;
		}
		return untracked(() => {
			isSearching.value = !kept.has(keyOf('remedies', at.id, at.etag));
			return askLater('remedies', at.id, at.etag, remedies, () => { isSearching.value = false; });
		});
	});
	effect(() => {
		const at = groupDocument.value;
		const view = at?.views.find(({ letter }) => letter === focused.value);
		const solved = at?.solution?.views.find((one) => one.view === view?.key);
		if (!at || !view || isPreview.value || !solved?.calibration.camera || Object.keys(view.lines).length === 0) {
			influence.value = null;
			return undefined;
		}
		return untracked(() => askLater('influence', view.id, at.etag, influence));
	});
}
