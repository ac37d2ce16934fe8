// @ts-check
/** Where the group stands in the queue, and the way to the next one. */

import { computed, signal } from '@preact/signals';

import { getGroups, getNeighbours } from '../api/client.js';
import { address, navigate, page, param } from '../lib/router.js';
import { stored } from '../lib/storage.js';
import { prefetch } from './documents.js';
import { settle, turnTo } from './group.js';
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

/**
 * Find out what comes before and after a group, and load what comes next.
 *
 * @param {number} id
 */
export async function locate(id) {
	const found = await getNeighbours(id, query.value);
	if (currentId() !== id) return;
	neighbours.value = { ...found, id };
	lastGroup.value = id;
	// What is on screen comes first.
	await prefetch([id, ...found.next]);
}

/** @returns {number | null} */
export function currentId() {
	return page.value.page === 'review' ? page.value.group : null;
}

/** Go to the group after this one; says so when there is none. */
export function goNext() {
	return go(neighbours.value?.next[0], 'This is the last group of the queue.');
}

/** Go to the group before this one. */
export function goPrevious() {
	return go(neighbours.value?.previous[0], 'This is the first group of the queue.');
}

/** @param {number | undefined} id @param {string} otherwise @returns {boolean} */
function go(id, otherwise) {
	if (id === undefined) {
		announce(otherwise);
		return false;
	}
	settle();
	dismiss();
	// At once, so that the next key already speaks about the next group.
	turnTo(id);
	navigate(reviewAddress(id));
	return true;
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
