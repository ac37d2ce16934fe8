// @ts-check
/** Own annotations: groups that are a copy which nobody else sees. */

import { signal } from '@preact/signals';

import { postIndependentAnnotation, putGold } from '../api/independent_annotations.js';
import { ApiError } from '../api/problem.js';
import { navigate } from '../lib/router.js';
import { groupDocument } from './group.js';
import { COPIES } from './me.js';
import { reviewAddress } from './navigation.js';
import { announce, complain, explain } from './notice.js';

/** Whether the guidelines are shown. */
export const guidelinesShown = signal(false);

/** @param {{dataset: {id: number}} | null} group */
export const isCopy = (group) => group !== null && group.dataset.id > COPIES;

/** @template T @param {() => Promise<T>} ask @returns {Promise<T | null>} */
async function told(ask) {
	try {
		return await ask();
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(error.message);
		return null;
	}
}

/** Begin an own annotation of the group, and open it. */
export async function annotateOwn() {
	const group = groupDocument.value;
	if (!group) return;
	if (isCopy(group)) { explain('This is already your independent annotation.'); return; }
	const take = await told(() => postIndependentAnnotation(group.id));
	if (take) navigate(reviewAddress(take.group));
}

/** Say that what the group holds is true. */
export async function markGold() {
	const group = groupDocument.value;
	const gold = group && await told(() => putGold(group.id, 'without_balls'));
	if (gold) announce(`${gold.label} is a gold group now. Choose under Statistics what annotators begin with.`);
}
