// @ts-check
/** Which tracks of a dataset a person works through, as the address says, and which comes next. */

import { queryText } from '../api/client.js';
import { getTracks } from '../api/tracks.js';

/** @import {ListedTrackJson, TrackChoice} from '../api/tracks.js' */

/** What of a list is shown; the first is all. */
export const SHOWN = /** @type {{show: string, label: string, choice: TrackChoice}[]} */ ([
	{ show: '', label: 'all', choice: {} },
	{ show: 'open', label: 'no verdict yet', choice: { verdict: 'none' } },
	{ show: 'stale', label: 'stale', choice: { stale: true } },
	{ show: 'accepted', label: 'accepted', choice: { verdict: 'accepted' } },
	{ show: 'rejected', label: 'rejected', choice: { verdict: 'rejected' } },
]);
/** Orders of a list; the first stands in no address. */
export const SORTS = /** @type {{sort: NonNullable<TrackChoice['sort']>, label: string}[]} */ ([
	{ sort: 'match', label: 'by match and frame' },
	{ sort: 'worst', label: 'largest left-out error first' },
	{ sort: 'gaps', label: 'most frames without a known ball first' },
]);

/** Parameters of an address that say which tracks. */
const NAMES = ['show', 'mine', 'batch', 'sort'];

/** @param {URLSearchParams} search @returns {Record<string, string>} */
export function listValues(search) {
	return Object.fromEntries(NAMES.map((name) => [name, search.get(name) ?? '']));
}

/** What the server is asked for. @param {Record<string, string>} values @param {string} me @returns {TrackChoice} */
export function choiceOf({ show, mine, batch, sort }, me) {
	const { choice } = SHOWN.find((one) => one.show === show) ?? SHOWN[0];
	return { ...choice, ...(mine ? { assigned: me } : {}), ...(Number(batch) ? { batch: Number(batch) } : {}), sort: SORTS.find((one) => one.sort === sort)?.sort };
}

/** The address of a track that keeps the list that it was reached from. @param {number} id @param {Record<string, string>} values */
export function trackAddress(id, values) {
	return `/tracks/${id}${queryText(values)}`;
}

/** The track behind another one in a list, else the first; null: there is none besides it. @param {{id: number}[]} items @param {number} id */
export function nextIn(items, id) {
	const place = items.findIndex((one) => one.id === id);
	const others = [...items.slice(place + 1), ...items.slice(0, Math.max(place, 0))];
	return others.find((one) => one.id !== id) ?? null;
}

/**
 * The next track that waits for a verdict, in the list that a track was reached from; null: none does.
 *
 * @param {{id: number, dataset: string}} track @param {Record<string, string>} values @param {string} me
 * @returns {Promise<ListedTrackJson | null>}
 */
export async function nextOpen(track, values, me) {
	// The one at hand is judged by now, so that it is found among all.
	const { items } = await getTracks(track.dataset, choiceOf({ ...values, show: '' }, me));
	const waits = items.filter((one) => one.id === track.id || (one.verdict === null && !one.summary.reason));
	return /** @type {ListedTrackJson | null} */ (nextIn(waits, track.id));
}
