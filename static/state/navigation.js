// @ts-check
/** Where the group stands in the queue, and the way to the next one. */

import { computed, signal } from '@preact/signals';

import { getGroups, getNeighbours } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { address, navigate, page, param } from '../lib/router.js';
import { stored } from '../lib/storage.js';
import { prefetch } from './documents.js';
import { groupDocument, open, settle } from './group.js';
import { complain, dismiss, explain } from './notice.js';

/** @import {Neighbours} from '../api/types.js' */

/** Neighbours of the group on screen; null until they are known. */
export const neighbours = signal(/** @type {(Neighbours & {id: number, q: string}) | null} */ (null));

/** Pages whose address has the query of a queue; others have words and batches of their own there. */
const WITH_QUERY = new Set(['queue', 'review', 'calibration', 'history', 'statistics']);

/** The query that makes the queue, as in the address bar. */
export const query = computed(() => {
	if (!WITH_QUERY.has(page.value.page)) return '';
	return /^\d+$/.test(param('batch')) ? `batch:${param('batch')}` : param('q');
});

/** The batch that is walked; null: another queue, or a part of one. */
export const batchId = computed(() => {
	const found = /^batch:(\d+)$/.exec(query.value.trim());
	return found ? Number(found[1]) : null;
});

/** The group that was last on screen, for the way back to it. */
export const lastGroup = stored('last-group', 0);

/** @param {number} id @param {string} [q] */
export function reviewAddress(id, q = query.value) {
	return address(`/review/${id}`, { q });
}

/** The way back to the group that was last on screen; the query of another dataset's page is none of its queue. @param {string} dataset of the page */
export function lastGroupAddress(dataset) {
	if (!lastGroup.value) return '/review';
	const group = groupDocument.value;
	const isElsewhere = group?.id === lastGroup.value && group.dataset.name !== dataset;
	return reviewAddress(lastGroup.value, isElsewhere ? '' : query.value);
}

/** Go back to a group, wherever the person is. @param {number} id @returns {Promise<boolean>} whether it is on screen */
export async function returnTo(id) {
	navigate(reviewAddress(id));
	if (groupDocument.value?.id !== id) await open(id);
	return groupDocument.value?.id === id;
}

/** The history of a group. @param {number} id */
export function historyAddress(id) {
	return address(`/review/${id}/history`, { q: query.value });
}

/** @param {string} dataset @param {string} q */
export function queueAddress(dataset, q) {
	return address('/groups', { dataset, q });
}

/** When the neighbours of the group on screen are known, or cannot be. */
let located = Promise.resolve();

/**
 * Find out what comes before and after a group, and load what comes next.
 *
 * @param {number} id
 */
export async function locate(id) {
	const q = query.value.trim();
	const asked = getNeighbours(id, q).then((found) => {
		if (currentId() === id && query.value.trim() === q) neighbours.value = { ...found, id, q };
		return found;
	});
	located = asked.then(() => {}, () => {});
	const found = await asked;
	if (currentId() !== id) return;
	lastGroup.value = id;
	// What is on screen comes first.
	await prefetch([id, ...found.next]);
}

/** Ask once more where the group on screen stands: the queue has changed meanwhile. */
export async function recount() {
	const at = neighbours.value;
	if (!at) return;
	try {
		const found = await getNeighbours(at.id, at.q);
		// Somebody who has gone on has asked already.
		if (neighbours.value === at) neighbours.value = { ...found, id: at.id, q: at.q };
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
	}
}

/** @returns {number | null} */
export function currentId() {
	return page.value.page === 'review' ? page.value.group : null;
}

/**
 * Go to the group after this one; says so, and answers false, when there is none.
 *
 * @param {() => boolean} [stillWanted] asked once it is known which group that is
 */
export function goNext(stillWanted) {
	return go(1, 'This is the last group of the queue.', stillWanted);
}

/** Go to the group before this one. */
export function goPrevious() {
	return go(-1, 'This is the first group of the queue.');
}

/**
 * At once where the queue is known, so that the next key already speaks about the next group;
 * whoever is faster than the answer about a group's neighbours goes on when it is there.
 *
 * @param {1 | -1} step @param {string} otherwise @param {() => boolean} [stillWanted]
 * @returns {Promise<boolean>}
 */
async function go(step, otherwise, stillWanted = () => true) {
	const from = currentId();
	let id = beside(from, step);
	if (id === undefined && neighbours.value?.id !== from) {
		await located;
		// The person has gone somewhere else meanwhile, or has a reason to stay.
		if (currentId() !== from || !stillWanted()) return true;
		id = beside(from, step);
	}
	if (id === undefined) {
		const unknown = neighbours.value?.id !== from;
		explain(unknown ? 'The queue cannot be read while the server is unreachable.' : otherwise);
		return unknown;
	}
	leaveFor(id);
	return true;
}

/** @param {number} id */
function leaveFor(id) {
	settle();
	dismiss();
	navigate(reviewAddress(id));
}

/** Groups that a person should look at: those with a finding. */
const FLAGGED = '-finding:none';

/**
 * Go several groups on or back, as far as there are any.
 *
 * @param {1 | -1} step @param {number} count more than one
 */
export function goBy(step, count) {
	return far(step < 0 ? 'This is the first group of the queue.' : 'This is the last group of the queue.', (from) => (
		distant(from, step, count)
	));
}

/** Go to the next or previous group of this queue that has a finding. @param {1 | -1} step */
export function goFlagged(step) {
	const words = step > 0 ? 'after' : 'before';
	return far(`No group with a finding comes ${words} this one.`, async (from) => {
		const found = await getNeighbours(from, `${query.value} ${FLAGGED}`.trim());
		return (step > 0 ? found.next : found.previous)[0];
	});
}

/**
 * Go where the server says; meanwhile the person may have gone elsewhere, which then counts.
 *
 * @param {string} otherwise @param {(from: number) => Promise<number | undefined>} find
 */
async function far(otherwise, find) {
	const from = currentId();
	if (from === null) return;
	try {
		const id = await find(from);
		if (currentId() !== from) return;
		if (id === undefined) explain(otherwise);
		else leaveFor(id);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`The queue cannot be read: ${error.message}`);
	}
}

/**
 * The group so many places away, or the last one before the end of the queue.
 *
 * @param {number} from @param {1 | -1} step @param {number} count
 * @returns {Promise<number | undefined>}
 */
async function distant(from, step, count) {
	let at = from;
	let left = count;
	while (left > 0) {
		const found = await getNeighbours(at, query.value);
		const beyond = (step > 0 ? found.next : found.previous).slice(0, left);
		if (beyond.length === 0) break;
		at = beyond[beyond.length - 1];
		left -= beyond.length;
	}
	return at === from ? undefined : at;
}

/** The group beside another one, as far as the queue is known. @param {number | null} from @param {1 | -1} step */
function beside(from, step) {
	const at = neighbours.value;
	if (!at || from === null) return undefined;
	const known = [...at.previous.toReversed(), at.id, ...at.next];
	const place = known.indexOf(from);
	return place < 0 ? undefined : known[place + step];
}

/**
 * The first group of the queue.
 *
 * @param {string} dataset
 * @returns {Promise<number | null>} null when nothing matches
 */
export async function firstGroup(dataset) {
	const found = await getGroups({ dataset, q: query.value, limit: 1 });
	return found.items[0]?.id ?? null;
}
