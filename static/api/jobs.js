// @ts-check
/** Requests about jobs: work that outlasts a request. */

import { queryText, request } from './client.js';

/** @typedef {'waiting' | 'running' | 'done' | 'failed' | 'cancelled'} JobState */

/**
 * @typedef {object} JobJson
 * @property {number} id
 * @property {string} kind
 * @property {string} title
 * @property {string | null} dataset
 * @property {JobState} state
 * @property {number} done
 * @property {number | null} total
 * @property {string} sentence
 * @property {any} result
 * @property {{detail: string, hint: string | null, pointer: string | null} | null} problem
 * @property {string} created
 * @property {string | null} started
 * @property {string | null} ended
 * @property {string} actor
 * @property {JobSubject | null} subject what it works on; null: it is about something else
 */
/** @typedef {{recording: number | null, first: number | null, last: number | null, link: number | null, practice: 'groups' | 'recording' | null}} JobSubject */

/** @param {{dataset?: string, kind?: string, state?: JobState | 'open', limit?: number, cursor?: string | null}} options @param {AbortSignal} [signal] @returns {Promise<{items: JobJson[], next: string | null}>} */
export function getJobs(options, signal) {
	return request(`/jobs${queryText(options)}`, { signal });
}

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<JobJson>} */
export function getJob(id, signal) {
	return request(`/jobs/${id}`, { signal });
}

/** @param {number} id @returns {Promise<JobJson>} */
export function cancelJob(id) {
	return request(`/jobs/${id}`, { method: 'DELETE' });
}
