// @ts-check
/** Requests about frozen versions and exports. */

import { idempotencyKey, queryText, request } from './client.js';

/** @import {JobJson} from './jobs.js' */

/** @typedef {{kind: 'given' | 'match' | 'camera', seed?: number | null, test_share?: number | null, test_cameras?: string[]}} SplitRequest */

/**
 * @typedef {object} FreezeRequest
 * @property {string} name
 * @property {string} note
 * @property {string} licence
 * @property {SplitRequest} split
 * @property {'accepted' | 'passing'} groups
 * @property {boolean} dry_run
 */

/** @typedef {{groups: number, splits: {[name: string]: number}, left_out: {[why: string]: number}, unsolved: number, tracks: number, stale_tracks: string[], views: {[name: string]: number}, unknown_cameras: string[]}} FreezePlan */

/**
 * @typedef {object} VersionJson
 * @property {number} id
 * @property {string} name
 * @property {string} hash
 * @property {string} created
 * @property {string} note
 * @property {string} [actor]
 * @property {string} [licence]
 * @property {any} counts
 * @property {any} policy
 * @property {any} split
 * @property {string} solver_version
 * @property {string} software_version
 * @property {VerificationJson | null} [verified] what came of verifying it the last time
 */

/**
 * @typedef {object} VerificationJson
 * @property {string} at
 * @property {string} actor
 * @property {string} solver_version
 * @property {boolean} ok
 * @property {string | null} problem
 * @property {string} sentence
 * @property {number | null} groups
 * @property {number | null} equal
 * @property {number | null} different
 * @property {{group: string | null, place: string, frozen: any, now: any}[]} differences
 */

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{items: VersionJson[]}>} */
export function getVersions(dataset, signal) {
	return request(`/datasets/${dataset}/versions`, { signal });
}

/** What freezing would take in; saves nothing. @param {number} dataset @param {FreezeRequest} body @param {AbortSignal} [signal] @returns {Promise<FreezePlan>} */
export function previewFreeze(dataset, body, signal) {
	return request(`/datasets/${dataset}/versions`, { method: 'POST', body: { ...body, dry_run: true }, signal });
}

/** @param {number} dataset @param {FreezeRequest} body @returns {Promise<JobJson>} */
export function postVersion(dataset, body) {
	return request(`/datasets/${dataset}/versions`, { method: 'POST', body: { ...body, dry_run: false }, key: idempotencyKey() });
}

/** @param {number} id @param {number} against @param {AbortSignal} [signal] @returns {Promise<any>} */
export function getDiff(id, against, signal) {
	return request(`/versions/${id}/diff${queryText({ against })}`, { signal });
}

/** @param {number} id @returns {Promise<JobJson>} */
export function verifyVersion(id) {
	return request(`/versions/${id}/verify`, { method: 'POST', key: idempotencyKey() });
}

/** The address of a version's manifest. @param {number} id */
export function manifestAddress(id) {
	return `/api/v1/versions/${id}/manifest`;
}
