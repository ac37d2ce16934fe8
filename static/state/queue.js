// @ts-check
/** The queue: the rows that match a query, loaded page by page as they come into sight. */

import { signal } from '@preact/signals';

import { getGroups, getSummary } from '../api/client.js';
import { ApiError } from '../api/problem.js';

/** @import {GroupRow} from '../api/types.js' */

/**
 * @typedef {object} Queue
 * @property {string} dataset
 * @property {string} q
 * @property {GroupRow[]} rows those loaded so far
 * @property {number} total rows that match
 * @property {string | null} next cursor of the page after them
 * @property {ApiError | null} error
 * @property {boolean} loaded whether the first page has arrived
 */

const PAGE = 200;

/** @type {Queue} */
const EMPTY = { dataset: '', q: '', rows: [], total: 0, next: null, error: null, loaded: false };

export const queue = signal(EMPTY);
/** Counts and histograms of what matches; null until they are known. */
export const summary = signal(/** @type {any} */ (null));
/** The row that keys move. */
export const activeRow = signal(0);

let controller = new AbortController();
let busy = false;

/**
 * Load the queue of a query from its start.
 *
 * @param {{id: number, name: string}} dataset @param {string} q
 */
export async function openQueue(dataset, q) {
	controller.abort();
	controller = new AbortController();
	const { signal: abort } = controller;
	const same = queue.value.dataset === dataset.name && queue.value.q === q;
	if (!same && queue.value.loaded) activeRow.value = 0;
	// Rows on screen stay until the new ones are there: nothing flickers while one types.
	queue.value = { ...queue.value, dataset: dataset.name, q };
	try {
		const [found, counted] = await Promise.all([
			getGroups({ dataset: dataset.name, q, cursor: null, limit: PAGE }, abort),
			getSummary(dataset.id, q, abort),
		]);
		if (abort.aborted) return;
		summary.value = counted;
		queue.value = {
			dataset: dataset.name, q, rows: found.items, total: found.total, next: found.next,
			error: null, loaded: true,
		};
	} catch (error) {
		if (abort.aborted) return;
		if (!(error instanceof ApiError)) throw error;
		queue.value = { ...EMPTY, dataset: dataset.name, q, error, loaded: true };
	}
}

/** Load pages until the row of that index is there. @param {number} index */
export async function need(index) {
	if (busy) return;
	busy = true;
	const { signal: abort } = controller;
	try {
		while (index >= queue.value.rows.length && queue.value.next && !abort.aborted) {
			const { dataset, q, next } = queue.value;
			const found = await getGroups({ dataset, q, cursor: next, limit: PAGE }, abort);
			if (abort.aborted) return;
			queue.value = {
				...queue.value, rows: [...queue.value.rows, ...found.items], next: found.next,
			};
		}
	} catch (error) {
		if (abort.aborted) return;
		if (!(error instanceof ApiError)) throw error;
		queue.value = { ...queue.value, error };
	} finally {
		busy = false;
	}
}

/** Forget what was loaded, so that the next visit shows what has changed since. */
export function closeQueue() {
	controller.abort();
}
