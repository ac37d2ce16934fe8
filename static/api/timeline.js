// @ts-check
/** The groups of a match over time. */

import { queryText, request } from './client.js';

/**
 * @typedef {object} TimelineJson columns: the values of one group stand at one index
 * @property {number} total
 * @property {number[]} id
 * @property {number[]} number
 * @property {(number | null)[]} frame
 * @property {(number | null)[]} error_px
 * @property {(boolean | null)[]} passes null where it is not solved
 * @property {(string | null)[]} gate the first failing gate
 * @property {string[]} status
 * @property {boolean[]} stale
 * @property {(number | null)[]} sigma_m
 * @property {([number, number, number] | null)[]} point
 */

/** @param {number} dataset @param {string} match @param {AbortSignal} [signal] @returns {Promise<TimelineJson>} */
export function getTimeline(dataset, match, signal) {
	return request(`/datasets/${dataset}/timeline${queryText({ match })}`, { signal });
}
