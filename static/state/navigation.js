// @ts-check
/** Where the group stands in the queue, and the way to the next one. */

import { computed, signal } from '@preact/signals';

import { getGroups, getNeighbours } from '../api/client.js';
import { address, navigate, page, param } from '../lib/router.js';
import { stored } from '../lib/storage.js';
import { prefetch } from './documents.js';
import { settle } from './group.js';
import { announce, dismiss } from './notice.js';

/** @import {Neighbours} from '../api/types.js' */

/** Neighbours of the group on screen; null until they are known. */
export const neighbours = signal(/** @type {(Neighbours & {id: number}) | null} */ (null));

/** The query that makes the queue, as in the address bar. */
export const query = computed(() => param('q'));

/** The group that was last on screen, for the way back to it. */
export const lastGroup = stored('last-group', 0);

/** @param {number} id @param {string} [q] */
export function reviewAddress(id, q = query.value) {
	return address(`/review/${id}`, { q });
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
	const asked = getNeighbours(id, query.value).then((found) => {
		if (currentId() === id) neighbours.value = { ...found, id };
		return found;
	});
	located = asked.then(() => {}, () => {});
	const found = await asked;
	if (currentId() !== id) return;
	lastGroup.value = id;
	// What is on screen comes first.
	await prefetch([id, ...found.next]);
}

/** @returns {number | null} */
export function currentId() {
	return page.value.page === 'review' ? page.value.group : null;
}

/** Go to the group after this one; says so, and answers false, when there is none. */
export function goNext() {
	return go(1, 'This is the last group of the queue.');
}

/** Go to the group before this one. */
export function goPrevious() {
	return go(-1, 'This is the first group of the queue.');
}

/**
 * At once where the queue is known, so that the next key already speaks about the next group;
 * whoever is faster than the answer about a group's neighbours goes on when it is there.
 *
 * @param {1 | -1} step @param {string} otherwise @returns {Promise<boolean>}
 */
async function go(step, otherwise) {
	const from = currentId();
	let id = beside(from, step);
	if (id === undefined && neighbours.value?.id !== from) {
		await located;
		// The person has gone somewhere else meanwhile.
		if (currentId() !== from) return true;
		id = beside(from, step);
	}
	if (id === undefined) {
		announce(otherwise);
		return false;
	}
	settle();
	dismiss();
	navigate(reviewAddress(id));
	return true;
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
	const found = await getGroups({ dataset, q: query.value, cursor: null, limit: 1 });
	return found.items[0]?.id ?? null;
}
