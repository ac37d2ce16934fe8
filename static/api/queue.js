// @ts-check
/** Requests about many groups at once: any place of the list, bulk verdicts, saved views, reviewers. */

import { idempotencyKey, queryText, request } from './client.js';

/** @typedef {{q: string, state: string, reason: string | null, note: string | null, expected?: number}} BulkRequest   `expected`: how many the person saw */
/** @typedef {{reason: string, groups: number}} RefusedJson */

/**
 * @typedef {object} BulkPreview
 * @property {number} matches
 * @property {number} would_change
 * @property {number} unchanged groups that have the verdict already
 * @property {{state: string, groups: number}[]} replaced the other verdicts of those that would change
 * @property {RefusedJson[]} refused
 * @property {{id: number, key: string, number: number, label: string}[]} sample
 */

/** @typedef {{batch: number | null, changed: number, refused: RefusedJson[]}} BulkResult */
/** @typedef {{id: number, at: string, actor: string, state: string, changed: number, undone: string | null, undone_by: string | null, redone: number | null}} BatchJson */
/** @typedef {{id: number, name: string, q: string, by: string, groups: number}} SavedView */

/**
 * @typedef {object} ReviewerJson
 * @property {string} name
 * @property {number} accepted
 * @property {number} rejected
 * @property {number} deferred
 * @property {number} today
 * @property {string | null} last
 */

/**
 * @typedef {object} QueryField   what a query can ask of a group
 * @property {string} name
 * @property {'number' | 'flag' | 'choice' | 'text' | 'ids' | 'order'} kind
 * @property {string} meaning
 * @property {string} unit
 * @property {string[]} operators
 * @property {string[]} values
 * @property {boolean} several whether a,b means either
 * @property {string[]} also other names that are understood
 */

/** @returns {Promise<{items: QueryField[], sorts: {name: string, meaning: string}[]}>} */
export function getQueryFields() {
	return request('/query-fields');
}

/** @param {{dataset: string, q: string, from: number, limit: number}} options @returns {Promise<{ids: number[], total: number}>} */
export function getGroupIds(options) {
	return request(`/groups/ids${queryText(options)}`);
}

/** @param {number} dataset @param {BulkRequest} body @param {AbortSignal} signal @returns {Promise<BulkPreview>} */
export function previewVerdicts(dataset, body, signal) {
	return request(`/datasets/${dataset}/verdicts?dry_run=true`, { method: 'POST', body, signal });
}

/** @param {number} dataset @param {BulkRequest} body @returns {Promise<BulkResult>} */
export function postVerdicts(dataset, body) {
	return request(`/datasets/${dataset}/verdicts?dry_run=false`, { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} batch @returns {Promise<{restored: number, kept: number}>} */
export function undoVerdicts(batch) {
	return request(`/verdict-batches/${batch}/undo`, { method: 'POST', key: idempotencyKey() });
}

/** @param {number} batch that was taken back @returns {Promise<{batch: number | null, changed: number, kept: number, refused: RefusedJson[]}>} batch: the new one */
export function redoVerdicts(batch) {
	return request(`/verdict-batches/${batch}/redo`, { method: 'POST', key: idempotencyKey() });
}

/** @param {number} dataset @param {AbortSignal} signal @returns {Promise<{items: BatchJson[]}>} */
export function getBatches(dataset, signal) {
	return request(`/datasets/${dataset}/verdict-batches?limit=6`, { signal });
}

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{items: SavedView[]}>} */
export function getSavedViews(dataset, signal) {
	return request(`/datasets/${dataset}/saved-views`, { signal });
}

/** @param {number} dataset @param {{name: string, q: string}} body @returns {Promise<SavedView>} */
export function postSavedView(dataset, body) {
	return request(`/datasets/${dataset}/saved-views`, { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} id */
export function deleteSavedView(id) {
	return request(`/saved-views/${id}`, { method: 'DELETE' });
}

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{items: ReviewerJson[]}>} */
export function getReviewers(dataset, signal) {
	return request(`/datasets/${dataset}/reviewers`, { signal });
}
