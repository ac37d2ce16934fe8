// @ts-check
/** Requests about the noise of a dataset. */

import { request } from './client.js';

/**
 * @typedef {object} AdviceJson
 * @property {string} name of the threshold
 * @property {string} label
 * @property {string} unit
 * @property {number} present
 * @property {number} estimate
 * @property {number} low end of the 95 % interval
 * @property {number} high
 * @property {boolean} agrees
 */

/**
 * @typedef {object} NoiseJson
 * @property {number} groups that were looked at
 * @property {number} solved
 * @property {{sigma_px: number, low: number, high: number, share: number, views: number} | null} lines
 * @property {AdviceJson[]} advice
 * @property {{[name: string]: number}} values thresholds that would agree; empty where they do
 * @property {string[]} notices
 */

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<NoiseJson>} */
export function getNoise(dataset, signal) {
	return request(`/datasets/${dataset}/noise`, { signal });
}
