// @ts-check
/** Requests about work that is given out: batches, the next group of one, and who has which open. */

import { request } from './client.js';

/** @import {ReturnedJson} from './independent_annotations.js' */

/** @typedef {{person: string, since: string}} Presence */
/** @typedef {'annotator' | 'reviewer'} Part */
/** @typedef {{id: number, dataset: string, name: string, kind: 'groups' | 'tracks', q: string, sort: string, verdicts: number, due: string | null, state: 'open' | 'closed', created: string, created_by: string, annotators: string[], reviewers: string[], groups: number, waiting: number, submitted: number, settled: number, last: string | null}} BatchJson */
/** @typedef {{batch: BatchJson, group: number | null, part: Part | null, until: string | null, here: Presence[], submitted_by: string | null, returned: ReturnedJson | null, place: number | null, of: number | null}} LeaseJson */
/** @typedef {{batch: BatchJson, parts: Part[], left: number, returned: ReturnedJson[], hides_groups: boolean}} MyBatchJson */
/** @typedef {{name: string, submitted: number, judged: number, groups: number, minutes: number, minutes_a_group: number | null, groups_an_hour: number | null}} PaceJson */
/** @typedef {{batch: BatchJson, gold_every: number | null, here: Presence[], stalled: string | null, people: PaceJson[]}} TeamBatchJson */
/** @typedef {{name: string, q: string, size: number | null, annotators: string[], reviewers: string[], due: string | null, skip_given: boolean, verdicts?: number, blind?: boolean, gold_every?: number | null, tracks?: number[]}} NewBatch */

/** @param {AbortSignal} [signal] @returns {Promise<{items: MyBatchJson[]}>} */
export const getMyWork = (signal) => request('/work', { signal });

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{items: TeamBatchJson[]}>} */
export const getTeamWork = (dataset, signal) => request(`/datasets/${dataset}/team-work`, { signal });

/** @param {string} dataset @param {AbortSignal} [signal] @returns {Promise<{items: BatchJson[]}>} */
export const getBatches = (dataset, signal) => request(`/datasets/${encodeURIComponent(dataset)}/batches`, { signal });

/** @param {number} dataset @param {NewBatch} body @returns {Promise<BatchJson>} */
export const postBatch = (dataset, body) => request(`/datasets/${dataset}/batches`, { method: 'POST', body });

/** @param {number} id @param {{name?: string, due?: string | null, annotators?: string[], reviewers?: string[], state?: 'open' | 'closed', gold_every?: number | null}} body @returns {Promise<BatchJson>} */
export const patchBatch = (id, body) => request(`/batches/${id}`, { method: 'PATCH', body });

/** @param {number} id */
export const deleteBatch = (id) => request(`/batches/${id}`, { method: 'DELETE' });

/** The next group that waits for whoever asks. @param {number} id @param {number | null} after @returns {Promise<LeaseJson>} */
export const postNext = (id, after) => request(`/batches/${id}/next`, { method: 'POST', body: after === null ? {} : { after } });

/** @param {number} id @param {number} group */
const at = (id, group) => `/batches/${id}/groups/${group}`;

/** @param {number} id @param {number} group @param {boolean} [over] @returns {Promise<LeaseJson>} */
export const putLease = (id, group, over = false) => request(`${at(id, group)}/lease`, { method: 'PUT', body: { take_over: over } });

/** Leave a group to others, also while the page goes away. @param {number} id @param {number} group */
export const deleteLease = (id, group) => request(`${at(id, group)}/lease`, { method: 'DELETE', keepalive: true });

/** @param {number} id @param {number} group @returns {Promise<LeaseJson>} */
export const putSubmission = (id, group) => request(`${at(id, group)}/submission`, { method: 'PUT' });

/** @param {number} id @param {number} group @param {string} reason @returns {Promise<LeaseJson>} */
export const postReturn = (id, group, reason) => request(`${at(id, group)}/return`, { method: 'POST', body: { reason } });
