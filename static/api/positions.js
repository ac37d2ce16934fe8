// @ts-check
/** Requests about where the main cameras of a dataset's matches stand. */

import { idempotencyKey, queryText, request } from './client.js';

/** @import {JobJson} from './jobs.js' */

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
export function takePositionsBack(dataset, match) {
	return request(`/datasets/${dataset}/positions${queryText({ match })}`, { method: 'DELETE', key: idempotencyKey() });
}
