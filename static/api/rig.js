// @ts-check
/** Requests about the static cameras of a dataset taken together. */

import { idempotencyKey, request } from './client.js';

/** @import {JobJson} from './jobs.js' */

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
