// @ts-check
/** Requests about a dataset as a whole. */

import { request } from './client.js';

/** @import {Counts} from './types.js' */

/** Delete a dataset with everything that belongs to it. @param {number} id @param {string} name typed by the person */
export function deleteDataset(id, name) {
	return request(`/datasets/${id}`, { method: 'DELETE', body: { confirm: name } });
}

/** What would go with it. @param {number} id @param {AbortSignal} [signal] @returns {Promise<{counts: Counts}>} */
export function previewDeletion(id, signal) {
	return request(`/datasets/${id}?dry_run=true`, { method: 'DELETE', body: {}, signal });
}
