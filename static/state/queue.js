// @ts-check
/** The queue: the rows that match a query, loaded page by page as they come into sight. */

import { signal } from '@preact/signals';

import { getGroups, getSummary } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { withField } from './query.js';

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
/** Far away, fewer and larger pages are faster. */
const FAR = 500;

/** @type {Queue} */
const EMPTY = { dataset: '', q: '', rows: [], total: 0, next: null, error: null, loaded: false };

export const queue = signal(EMPTY);
/** Counts and histograms of what matches; null until they are known. */
export const summary = signal(/** @type {any} */ (null));
/** Counts of the same query without its status, for the buttons that choose one. */
export const statusCounts = signal(/** @type {{[status: string]: number} | null} */ (null));
/** The row that keys move. */
export const activeRow = signal(0);

/** Dataset and query, without its order, that the counts speak about. */
let countedFor = '';

/** @param {{id: number}} dataset @param {string} q */
function countsKey(dataset, q) {
	return `${dataset.id} ${withField(q, 'sort', [])}`;
}

/**
 * Read the counts of a query, and those without its status.
 *
 * @param {{id: number}} dataset @param {string} q @param {AbortSignal} abort
 */
async function count(dataset, q, abort) {
	const plain = withField(q, 'status', []);
	try {
		const [counted, all] = await Promise.all([
			getSummary(dataset.id, q, abort),
			plain === q.trim() ? null : getSummary(dataset.id, plain, abort),
		]);
		if (abort.aborted) return;
		summary.value = counted;
		statusCounts.value = (all ?? counted).progress;
		countedFor = countsKey(dataset, q);
	} catch (error) {
		// The rows' own request says what is wrong.
		if (!abort.aborted && !(error instanceof ApiError)) throw error;
	}
}

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
	const before = queue.value;
	const same = before.dataset === dataset.name && before.q === q;
	if (!same && before.loaded) activeRow.value = 0;
	// Rows on screen stay until the new ones are there: nothing flickers while one types.
	queue.value = { ...queue.value, dataset: dataset.name, q };
	try {
		// The counts do not depend on the order; rows do not wait for them.
		const turned = before.q !== q && countedFor === countsKey(dataset, q);
		const counting = turned ? null : count(dataset, q, abort);
		const found = await getGroups({ dataset: dataset.name, q, cursor: null, limit: PAGE }, abort);
		if (abort.aborted) return;
		queue.value = {
			dataset: dataset.name, q, rows: found.items, total: found.total, next: found.next,
			error: null, loaded: true,
		};
		await counting;
	} catch (error) {
		if (abort.aborted) return;
		if (!(error instanceof ApiError)) throw error;
		queue.value = { ...EMPTY, dataset: dataset.name, q, error, loaded: true };
	}
}

/** Read the counts of the present query again. @param {{id: number}} dataset */
export async function recount(dataset) {
	await count(dataset, queue.value.q, controller.signal);
}

/** Load pages until the row of that index is there. @param {number} index */
export async function need(index) {
	if (busy) return;
	busy = true;
	const { signal: abort } = controller;
	try {
		while (index >= queue.value.rows.length && queue.value.next && !abort.aborted) {
			const { dataset, q, next, rows } = queue.value;
			const limit = index - rows.length > PAGE ? FAR : PAGE;
			const found = await getGroups({ dataset, q, cursor: next, limit }, abort);
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

/** Put newer rows in the place of older ones. @param {GroupRow[]} changed */
export function replaceRows(changed) {
	const byId = new Map(changed.map((row) => [row.id, row]));
	queue.value = { ...queue.value, rows: queue.value.rows.map((row) => byId.get(row.id) ?? row) };
}

/** Forget what was loaded, so that the next visit shows what has changed since. */
export function closeQueue() {
	controller.abort();
}
