// @ts-check
/** Requests about the noise of a dataset. */

import { idempotencyKey, request } from './client.js';

/** @import {JobJson} from './jobs.js' */

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
export function takeNoiseBack(dataset) {
	return request(`/datasets/${dataset}/noise`, { method: 'DELETE', key: idempotencyKey() });
}
