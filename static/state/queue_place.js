// @ts-check
/** Where somebody is in the queue: kept for the way back, and over a reload. */

import { signal } from '@preact/signals';

import { stored } from '../lib/storage.js';
import { groupDocument } from './group.js';
import { neighbours } from './navigation.js';
import { queueKey } from './query.js';
import { activeRow } from './queue.js';

/** `top` is the first row in sight, not always a whole one. */
const place = stored('queue-place', { key: '', active: 0, top: 0 }, 'sessionStorage');

/** How often somebody has come to the queue. */
export const arrivals = signal(0);

/** Take the row up again that keys moved from: that of the group just left, else the last one. @param {string} dataset @param {string} q */
export function resume(dataset, q) {
	const key = queueKey(dataset, q);
	const left = neighbours.value;
	const here = left !== null && left.q === q.trim() && groupDocument.value?.id === left.id
		&& groupDocument.value.dataset.name === dataset;
	activeRow.value = (here ? left.index : null) ?? leftAt(key).active;
	arrivals.value += 1;
}

/** @param {string} key of the rows @param {number} top */
export function remember(key, top) {
	const active = activeRow.value;
	const { value } = place;
	if (value.key === key && value.active === active && value.top === top) return;
	place.value = { key, active, top };
}

/** Where these rows were last left: the active row, and the first one in sight. @param {string} key */
export function leftAt(key) {
	const { active, top } = place.value;
	return place.value.key === key ? { active, top } : { active: 0, top: 0 };
}
