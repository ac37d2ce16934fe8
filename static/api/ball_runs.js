// @ts-check
/** Requests about ball runs: a click on the ball, followed through a shot of a recording. */

import { idempotencyKey, request, requestTagged } from './client.js';

/** @typedef {{frame: number, x: number, y: number}} BallClick   pixels of the recording */
/**
 * @typedef {object} BallRunJson
 * @property {number} id
 * @property {BallClick[]} clicks
 * @property {number} first
 * @property {number} last
 * @property {'lost' | 'left' | 'limit'} before why it begins there
 * @property {'lost' | 'left' | 'limit'} after why it ends there
 * @property {number} followed
 * @property {number} uncertain
 * @property {number[]} confirmed uncertain frames that are right
 * @property {string | null} accepted_by
 * @property {number | null} placed views that have the ball from it
 * @property {number | null} kept views that had another one
 * @property {number | null} refused views that could not be edited
 * @property {boolean} stale
 * @property {string} etag
 */
/**
 * Columns: the same place is the same frame.
 *
 * @typedef {BallRunJson & {frame: number[], x: number[], y: number[], diameter: number[], sigma_px: number[], confidence: number[], state: string}} BallRunFrames
 */

/** @param {number} id of the recording @param {AbortSignal} [signal] @returns {Promise<{items: BallRunJson[], following: number[]}>} `following`: frames whose clicks are being followed */
export function getBallRuns(id, signal) {
	return request(`/recordings/${id}/ball-runs`, { signal });
}

/** @param {number} id @param {number} run @param {AbortSignal} [signal] @returns {Promise<BallRunFrames>} */
export function getBallRun(id, run, signal) {
	return request(`/recordings/${id}/ball-runs/${run}`, { signal });
}

/** Follow the ball from a click. @param {number} id @param {BallClick} click @returns {Promise<BallRunFrames>} */
export function postBallRun(id, click) {
	return request(`/recordings/${id}/ball-runs`, { method: 'POST', body: click, key: idempotencyKey() });
}

/** Follow it from one more click. @param {number} id @param {BallRunJson} run @param {BallClick} click @returns {Promise<BallRunFrames>} */
export async function postBallClick(id, { id: run, etag }, click) {
	return (await requestTagged(`/recordings/${id}/ball-runs/${run}/clicks`, { method: 'POST', body: click, etag, key: idempotencyKey() })).json;
}

/** @param {number} id @param {BallRunJson} run @param {{accepted?: boolean, confirmed?: number[]}} change @returns {Promise<BallRunFrames>} */
export async function patchBallRun(id, { id: run, etag }, change) {
	return (await requestTagged(`/recordings/${id}/ball-runs/${run}`, { method: 'PATCH', body: change, etag, key: idempotencyKey() })).json;
}

/** @param {number} id @param {number} run */
export function deleteBallRun(id, run) {
	return request(`/recordings/${id}/ball-runs/${run}`, { method: 'DELETE' });
}
