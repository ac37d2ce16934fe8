// @ts-check
/** Requests about the pitches of a dataset's matches. */

import { idempotencyKey, request, requestTagged } from './client.js';

/** @import {JobJson} from './jobs.js' */

/** @typedef {{length: number, width: number}} PitchSizeJson   metres */

/**
 * @typedef {object} MatchPitchJson
 * @property {string} match
 * @property {string} group key of its first group
 * @property {number} group_id
 * @property {number} groups
 * @property {number} length in use, metres
 * @property {number} width
 * @property {boolean} mixed its groups were brought with several sizes
 * @property {{length: number | null, width: number | null, length_sigma_m: number | null, width_sigma_m: number | null, frames: number} | null} estimate null: not computed
 * @property {string | null} problem why it cannot be
 * @property {PitchSizeJson | null} proposed
 * @property {PitchSizeJson | null} previous the size before it was changed last
 */

/** @typedef {{etag: string, items: MatchPitchJson[]}} PitchesJson */

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<PitchesJson>} */
export async function getPitches(dataset, signal) {
	const { json } = await requestTagged(`/datasets/${dataset}/pitches`, { signal });
	return json;
}

/** Estimate the pitches that are not estimated yet. @param {number} dataset @returns {Promise<JobJson>} */
export function estimatePitches(dataset) {
	return request(`/datasets/${dataset}/pitches`, { method: 'POST', key: idempotencyKey() });
}

/** Give a match another pitch. @param {number} dataset @param {string} match @param {PitchSizeJson} size @param {string} etag @returns {Promise<JobJson>} */
export function setPitch(dataset, match, { length, width }, etag) {
	return request(`/datasets/${dataset}/pitches`, { method: 'PATCH', body: { match, length, width }, etag, key: idempotencyKey() });
}
