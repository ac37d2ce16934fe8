// @ts-check
/** Requests about what was done to the pictures of a dataset's matches. */

import { idempotencyKey, request } from './client.js';

/** @import {JobJson} from './jobs.js' */
/** @import {PictureJson} from './types.js' */

/**
 * @typedef {object} MatchPictureJson
 * @property {string} match
 * @property {number} frames pictures of the main camera that have lines
 * @property {PictureJson | null} picture null: as they were taken
 * @property {boolean} mixed they are not all alike
 */

/**
 * @typedef {object} PictureEstimateJson   of the result of the job that estimates
 * @property {string} match
 * @property {PictureJson | null} estimate null: too few frames show enough
 * @property {PictureJson | null} proposed null: nothing certainly happened
 * @property {string} sentence
 */

/** @typedef {{items: MatchPictureJson[]}} MatchPicturesJson */

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<MatchPicturesJson>} */
export function getMatchPictures(dataset, signal) {
	return request(`/datasets/${dataset}/pictures`, { signal });
}

/** Look at the lines of all matches. @param {number} dataset @returns {Promise<JobJson>} */
export function estimateMatchPictures(dataset) {
	return request(`/datasets/${dataset}/pictures`, { method: 'POST', body: {}, key: idempotencyKey() });
}

/** @param {number} dataset @param {string} match @param {PictureJson | null} picture null: as they were taken @returns {Promise<JobJson>} */
export function setMatchPicture(dataset, match, picture) {
	return request(`/datasets/${dataset}/pictures`, { method: 'PATCH', body: { match, picture }, key: idempotencyKey() });
}
