// @ts-check
/** The queue: the rows that match a query, read where somebody looks. */

import { signal } from '@preact/signals';

import { getGroups, getSummary } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { complain } from './notice.js';
import { queueKey, withField } from './query.js';
import { indexOf, PAGE, pagesOf, rowAt, withPage } from './queue_pages.js';

/** @import {Pages} from './queue_pages.js' */

/**
 * @typedef {object} Queue
 * @property {string} dataset
 * @property {string} q
 * @property {string} shown dataset and query of the rows; "" while there are none
 * @property {Pages} pages
 * @property {number} total rows that match
 * @property {ApiError | null} error
 * @property {boolean} loaded whether there was an answer
 */

/** Rows beyond those in sight that are read with them. */
const AHEAD = 20;
/** Whoever jumps again within this time, ms, is passing by: a scroll bar that is dragged. */
const PAUSE = 120;

/** @type {Queue} */
const EMPTY = { dataset: '', q: '', shown: '', pages: new Map(), total: 0, error: null, loaded: false };

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
/** While another query is asked, its rows come first. */
let opening = false;
/** Rows in sight. */
let sight = { first: 0, last: 0 };

/**
 * Read the queue of a query: around the active row, or, when it is shown already, what is in sight.
 *
 * @param {{id: number, name: string}} dataset @param {string} q
 */
export async function openQueue(dataset, q) {
	controller.abort();
	controller = new AbortController();
	const { signal: abort } = controller;
	const before = queue.value;
	const again = before.shown === queueKey(dataset.name, q);
	if (!again) sight = { first: activeRow.value, last: activeRow.value };
	// Rows on screen stay until the new ones are there: nothing flickers while one types.
	queue.value = { ...before, dataset: dataset.name, q };
	opening = true;
	try {
		// The counts do not depend on the order; rows do not wait for them.
		const turned = before.q !== q && countedFor === countsKey(dataset, q);
		const counting = turned ? null : count(dataset, q, abort);
		await readAnew(dataset.name, q, abort);
		await counting;
	} catch (error) {
		if (abort.aborted) return;
		if (!(error instanceof ApiError)) throw error;
		queue.value = { ...EMPTY, dataset: dataset.name, q, error, loaded: true };
		// Counts of the query before say nothing of one that cannot be read.
		summary.value = null;
		statusCounts.value = null;
		countedFor = '';
	} finally {
		if (!abort.aborted) opening = false;
	}
}

/** Put the pages in sight in the place of all that are there. @param {string} dataset @param {string} q @param {AbortSignal} abort */
async function readAnew(dataset, q, abort) {
	const wanted = pagesOf(sight.first, sight.last);
	const answers = await Promise.all(wanted.map((page) => readPage(dataset, q, page, abort)));
	if (abort.aborted) return;
	const total = answers[answers.length - 1].total;
	const pages = new Map(wanted.map((page, place) => [page, answers[place].items]));
	// The active row, which keys may have moved meanwhile, stays with its group, wherever that stands now.
	const { pages: before, shown } = queue.value;
	const known = shown === queueKey(dataset, q) ? rowAt(before, activeRow.value) : null;
	const moved = known ? indexOf(pages, known.id) : -1;
	activeRow.value = Math.max(0, Math.min(moved < 0 ? activeRow.value : moved, total - 1));
	opening = false;
	queue.value = { dataset, q, shown: queueKey(dataset, q), pages, total, error: null, loaded: true };
}

/** @param {string} dataset @param {string} q @param {number} page @param {AbortSignal} abort */
function readPage(dataset, q, page, abort) {
	return getGroups({ dataset, q, from: page * PAGE, limit: PAGE }, abort);
}

/** Whether it is the query that cannot be read: asking once more changes nothing. @param {ApiError | null} error */
export function isUnreadable(error) {
	return error?.status === 400 || error?.status === 422;
}

/** What is being read, by page. @type {Map<number, AbortController>} */
const reading = new Map();
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;
let jumped = -Infinity;

/** Say which rows are in sight: what is missing is read, what was passed is not waited for. @param {number} first @param {number} last */
export function look(first, last) {
	const far = Math.abs(first - sight.first) > AHEAD;
	const passing = far && performance.now() - jumped < PAUSE;
	if (far) jumped = performance.now();
	sight = { first, last };
	const wanted = pagesInSight();
	for (const [page, abort] of reading) {
		if (wanted.includes(page)) continue;
		abort.abort();
		reading.delete(page);
	}
	if (passing) clearTimeout(timer);
	if (passing || timer === undefined) timer = setTimeout(readSight, passing ? PAUSE : 0);
}

function pagesInSight() {
	return pagesOf(sight.first - AHEAD, sight.last + AHEAD, queue.value.total);
}

function readSight() {
	timer = undefined;
	if (opening || queue.value.shown === '') return;
	const missing = pagesInSight().filter((page) => !queue.value.pages.has(page) && !reading.has(page));
	for (const page of missing) readMissing(page);
}

/** @param {number} page */
async function readMissing(page) {
	const abort = new AbortController();
	const signals = AbortSignal.any([abort.signal, controller.signal]);
	reading.set(page, abort);
	const { dataset, q } = queue.value;
	try {
		const found = await readPage(dataset, q, page, signals);
		if (signals.aborted) return;
		// Where the number of rows has changed, places have too.
		const kept = found.total === queue.value.total ? queue.value.pages : new Map();
		queue.value = { ...queue.value, pages: withPage(kept, page, found.items), total: found.total };
	} catch (error) {
		if (signals.aborted) return;
		if (!(error instanceof ApiError)) throw error;
		complain(`These rows cannot be read: ${error.message}`, { label: 'Try again', run: readSight });
	} finally {
		if (reading.get(page) === abort) reading.delete(page);
	}
}

/** Forget what is on its way, so that the next visit shows what has changed since. */
export function closeQueue() {
	controller.abort();
	clearTimeout(timer);
	timer = undefined;
}
