// @ts-check
/** For completion: what a query can ask, and values that a dataset has, its splits, matches and reviewers. */

import { signal } from '@preact/signals';

import { getQueryFields, getReviewers } from '../api/queue.js';
import { ApiError } from '../api/problem.js';
import { getStatistics } from '../api/statistics.js';
import { dataset } from './datasets.js';

/** @import {QueryField} from '../api/queue.js' */
/** @import {Facets} from './completion.js' */

export const facets = signal(/** @type {Facets} */ ({}));
export const queryFields = signal(/** @type {QueryField[]} */ ([]));

let known = 0;

/** What a query can ask: read once. */
async function loadFields() {
	if (queryFields.value.length) return;
	try {
		queryFields.value = (await getQueryFields()).items;
	} catch (error) {
		// Completion does without; the next focus tries again.
		if (!(error instanceof ApiError)) throw error;
	}
}

/** Read them, once for each dataset. */
export async function loadFacets() {
	loadFields();
	const one = dataset.value;
	if (!one || known === one.id) return;
	known = one.id;
	facets.value = {};
	try {
		const [statistics, reviewers] = await Promise.all([getStatistics(one.id, ''), getReviewers(one.id)]);
		if (known !== one.id) return;
		facets.value = {
			split: statistics.splits.map(({ split }) => split),
			match: statistics.matches.map(({ match }) => match),
			reviewer: reviewers.items.map(({ name }) => name),
		};
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		// Completion does without; the next focus tries again.
		known = 0;
	}
}
