// @ts-check
/** Requests about what the frames of a match show together: its pitch, its main camera, noise, static cameras. */

import { idempotencyKey, queryText, request, requestTagged } from './client.js';

/** @import {JobJson} from './jobs.js' */
/** @import {PictureJson} from './types.js' */

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

/** @param {number | string} dataset its id or name @param {AbortSignal} [signal] @returns {Promise<PitchesJson>} */
export async function getPitches(dataset, signal) {
	const { json } = await requestTagged(`/datasets/${dataset}/pitches`, { signal });
	return json;
}

/** Estimate the pitches that are not estimated yet. @param {number} dataset @returns {Promise<JobJson>} */
export function estimatePitches(dataset) {
	return request(`/datasets/${dataset}/pitches`, { method: 'POST', key: idempotencyKey() });
}

/** Give a match another pitch. @param {number | string} dataset its id or name @param {string} match @param {PitchSizeJson} size @param {string} etag @returns {Promise<JobJson>} */
export function setPitch(dataset, match, { length, width }, etag) {
	return request(`/datasets/${dataset}/pitches`, { method: 'PATCH', body: { match, length, width }, etag, key: idempotencyKey() });
}

/**
 * @typedef {object} MatchPositionJson
 * @property {string} match
 * @property {number} groups
 * @property {number} views pictures of the main camera that have lines
 * @property {number} shared how many have what the others say of its position
 * @property {[number, number, number] | null} mean pitch frame, metres
 * @property {number | null} sigma_m
 * @property {boolean | null} current whether it would be estimated from the same now; null: nothing is shared
 * @property {string} sentence
 */

/** @typedef {{used: boolean, items: MatchPositionJson[]}} PositionsJson */

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<PositionsJson>} */
export function getPositions(dataset, signal) {
	return request(`/datasets/${dataset}/positions`, { signal });
}

/** Share the position in a match. @param {number} dataset @param {string} match @returns {Promise<JobJson>} */
export function sharePositions(dataset, match) {
	return request(`/datasets/${dataset}/positions`, { method: 'POST', body: { match }, key: idempotencyKey() });
}

/** Give a match what it had before. @param {number} dataset @param {string} match @returns {Promise<JobJson>} */
export function revertPositions(dataset, match) {
	return request(`/datasets/${dataset}/positions${queryText({ match })}`, { method: 'DELETE', key: idempotencyKey() });
}

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

/**
 * @typedef {object} AdviceJson
 * @property {string} name of the threshold
 * @property {string} label
 * @property {string} unit
 * @property {number | null} present null: left to each image
 * @property {number} estimate
 * @property {number} low end of the 95 % interval
 * @property {number} high
 * @property {boolean} agrees
 */

/**
 * @typedef {object} SourceNoiseJson
 * @property {string} source key of the station, or name of the person
 * @property {number} sigma_px at 1920x1080
 * @property {number} low end of the 95 % interval
 * @property {number} high
 * @property {boolean} differs from the dataset's
 */

/**
 * @typedef {object} NoiseJson
 * @property {number} groups that were looked at
 * @property {number} solved
 * @property {boolean} follows the policy uses the estimates, as of each solve of the dataset
 * @property {AdviceJson[]} advice
 * @property {{[name: string]: number}} values thresholds that would agree; empty where they do
 * @property {SourceNoiseJson[]} stations static cameras, the noisiest first
 * @property {SourceNoiseJson[]} people who placed balls last
 * @property {FactorJson[]} factors of cameras and people together; empty where all may be alike
 * @property {FactorJson[]} used those that sigma uses now
 * @property {boolean} is_new `factors` say something else than `used`
 * @property {string[]} notices
 */

/** @typedef {{camera: string | null, person: string | null, ratio: number}} FactorJson   null: any other */

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<NoiseJson>} */
export function getNoise(dataset, signal) {
	return request(`/datasets/${dataset}/noise`, { signal });
}

/** Judge by the estimates. @param {number} dataset @returns {Promise<JobJson>} */
export function acceptNoise(dataset) {
	return request(`/datasets/${dataset}/noise`, { method: 'POST', key: idempotencyKey() });
}

/** Take the balls of all cameras and people to be alike. @param {number} dataset @returns {Promise<JobJson>} */
export function revertNoise(dataset) {
	return request(`/datasets/${dataset}/noise`, { method: 'DELETE', key: idempotencyKey() });
}

/**
 * @typedef {object} RigCamera
 * @property {string} key
 * @property {number} moved_m
 * @property {number} turned_degrees
 * @property {number} focal_percent
 * @property {number} picture_px
 * @property {number} position_sigma_m
 * @property {number | null} lines_before_px
 * @property {number | null} lines_after_px
 */
/**
 * @typedef {object} RigPair
 * @property {string} a
 * @property {string} b
 * @property {number} frames
 * @property {number} before_px
 * @property {number} after_px
 * @property {number} held_out
 * @property {number | null} held_out_before_px
 * @property {number | null} held_out_after_px
 */
/**
 * @typedef {object} RigProposal
 * @property {RigCamera[]} cameras
 * @property {RigPair[]} pairs
 * @property {string[]} left_alone
 * @property {number} frames
 * @property {number} gross
 * @property {number} ball_moved_m
 * @property {string} anchor
 * @property {string} time
 * @property {string} inputs
 */
/** @typedef {'cameras' | 'sigma'} Accepted */

/**
 * Adjust the static cameras of a dataset; with `accept` what was proposed is saved.
 *
 * @param {number} dataset @param {{accept?: Accepted, inputs?: string}} [body] @returns {Promise<JobJson>}
 */
export function postRig(dataset, body = {}) {
	return request(`/datasets/${dataset}/rig`, { method: 'POST', body, key: idempotencyKey() });
}

/** Take an accepted rig back. @param {number} dataset @returns {Promise<{taken_back: number}>} */
export function deleteRig(dataset) {
	return request(`/datasets/${dataset}/rig`, { method: 'DELETE' });
}
