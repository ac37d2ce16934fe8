// @ts-check
/** Requests about recordings: their frames, their shots, and the groups that are made of them. */

import { idempotencyKey, queryText, request, requestTagged } from './client.js';

/** @import {ImportSource} from './imports.js' */
/** @import {JobJson} from './jobs.js' */

/**
 * @typedef {object} RecordingJson
 * @property {number} id
 * @property {string} dataset
 * @property {string} name
 * @property {boolean} indexed
 * @property {number | null} frames
 * @property {number | null} fps
 * @property {boolean | null} variable
 * @property {number | null} seconds
 * @property {number | null} width
 * @property {number | null} height
 * @property {boolean | null} interlaced
 * @property {number} shots
 * @property {number} groups
 * @property {string | null} problem
 * @property {string} created
 */

/** @typedef {'main' | 'replay' | 'closeup' | 'other'} ShotKind */
/** @typedef {'start' | 'cut' | 'dissolve' | 'wipe' | 'fade'} ShotStart */
/** @typedef {{first: number, last: number, kind: ShotKind, entered_by: ShotStart, kept: boolean | null}} Shot   `kept` null: nobody said */
/** @typedef {Shot & {start_s: number, end_s: number}} TimedShot */

/** @param {AbortSignal} [signal] @returns {Promise<{items: RecordingJson[]}>} */
export function getRecordings(signal) {
	return request('/recordings', { signal });
}

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<RecordingJson>} */
export function getRecording(id, signal) {
	return request(`/recordings/${id}`, { signal });
}

/** @param {{dataset: string, source: ImportSource}} body @returns {Promise<JobJson>} */
export function postRecording(body) {
	return request('/recordings', { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} id */
export function deleteRecording(id) {
	return request(`/recordings/${id}`, { method: 'DELETE' });
}

/** Where a frame is, as wide as it is shown. @param {number} id @param {number} frame @param {number} width pixels */
export function frameAddress(id, frame, width) {
	return `/api/v1/recordings/${id}/frames/${frame}${queryText({ width })}`;
}

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<{items: TimedShot[], etag: string}>} */
export function getShots(id, signal) {
	return request(`/recordings/${id}/shots`, { signal });
}

/** @param {number} id @param {Shot[]} shots @param {string} etag @returns {Promise<{items: TimedShot[], etag: string}>} */
export async function putShots(id, shots, etag) {
	const body = { shots: shots.map(({ first, last, kind, entered_by, kept }) => ({ first, last, kind, entered_by, kept })) };
	return (await requestTagged(`/recordings/${id}/shots`, { method: 'PUT', body, etag, key: idempotencyKey() })).json;
}

/** @param {number} id @returns {Promise<JobJson>} */
export function findShots(id) {
	return request(`/recordings/${id}/shots`, { method: 'POST', key: idempotencyKey() });
}

/** @param {number} id @param {number[]} frames @param {boolean} propose whether cameras are proposed afterwards @returns {Promise<JobJson>} */
export function postInstants(id, frames, propose) {
	return request(`/recordings/${id}/groups`, { method: 'POST', body: { frames, propose }, key: idempotencyKey() });
}
