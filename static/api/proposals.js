// @ts-check
/** Requests about lines that are proposed for views without a camera. */

import { idempotencyKey, request } from './client.js';

/** @import {JobJson} from './jobs.js' */
/** @import {LinesJson} from './types.js' */

/**
 * @typedef {object} ViewProposalJson what was proposed for one view
 * @property {number} view
 * @property {string} key
 * @property {boolean} open whether the view has the lines that it had when it was looked at, and no given camera
 * @property {'proposed' | 'unsure' | 'nothing'} outcome
 * @property {string} sentence why nothing is proposed, or which drawn lines lie elsewhere
 * @property {LinesJson} lines markings that nobody drew
 * @property {number | null} supported
 * @property {number | null} explained
 * @property {number} points
 * @property {number | null} error_px
 * @property {number | null} runner_up how much less the next best camera agrees
 */
/**
 * @typedef {object} MatchProposalsJson
 * @property {string} match
 * @property {number} views without a camera, with a picture
 * @property {number} looked how many of them were looked at
 * @property {number} proposed
 * @property {number} unsure
 * @property {number} nothing
 * @property {number} accepted
 */

/** @param {number} group @param {AbortSignal} [signal] @returns {Promise<{items: ViewProposalJson[]}>} */
export function getGroupProposals(group, signal) {
	return request(`/groups/${group}/proposals`, { signal });
}

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{items: MatchProposalsJson[]}>} */
export function getProposals(dataset, signal) {
	return request(`/datasets/${dataset}/proposals`, { signal });
}

/** Look at every view without a camera. @param {number} dataset @returns {Promise<JobJson>} */
export function proposeForDataset(dataset) {
	return request(`/datasets/${dataset}/proposals`, { method: 'POST', body: {}, key: idempotencyKey() });
}

/** @param {number} dataset @returns {Promise<{forgotten: number}>} */
export function forgetProposals(dataset) {
	return request(`/datasets/${dataset}/proposals`, { method: 'DELETE', key: idempotencyKey() });
}
