// @ts-check
/** Requests about the painted lines that a frame shows. */

import { idempotencyKey, request } from './client.js';

/** @import {JobJson} from './jobs.js' */
/** @import {LinesJson} from './types.js' */

/** @typedef {[x: number, y: number, sigma: number]} PaintPlace pixels of the annotated size */
/**
 * @typedef {object} PaintJson
 * @property {'snapped' | 'kept' | 'nothing'} outcome
 * @property {'no_paint' | 'paint_disagrees' | null} reason
 * @property {string} sentence
 * @property {Record<string, PaintPlace[]>} points in their order along each marking
 * @property {[number, number][]} line_like
 * @property {number | null} supported
 * @property {number | null} explained
 * @property {number | null} error_px
 * @property {number | null} moved_px
 */
/**
 * @typedef {object} ProposalJson
 * @property {'proposed' | 'unsure' | 'nothing'} outcome
 * @property {string} sentence
 * @property {LinesJson} lines
 * @property {number | null} supported
 * @property {number | null} explained
 * @property {number | null} runner_up
 * @property {number | null} error_px
 * @property {number} points
 */

/**
 * What the frame shows near the camera that these lines make.
 *
 * @param {number} view @param {Record<string, import('./types.js').PointJson[] | null>} lines changes that are not saved
 * @param {AbortSignal} [signal]
 * @returns {Promise<PaintJson>}
 */
export function readPaint(view, lines, signal) {
	return request(`/views/${view}/paint`, { method: 'POST', body: { lines }, signal });
}

/**
 * Lines for a view without a camera, beside those that it has.
 *
 * @param {number} view @param {Record<string, import('./types.js').PointJson[] | null>} lines changes that are not saved
 * @param {AbortSignal} [signal]
 * @returns {Promise<ProposalJson>}
 */
export function proposeLines(view, lines, signal) {
	return request(`/views/${view}/propose`, { method: 'POST', body: { lines }, signal });
}

/**
 * @typedef {object} MatchPaintJson
 * @property {string} match
 * @property {number} groups
 * @property {number} views those of which paint could place the camera
 * @property {number} without_picture
 * @property {number} read
 * @property {number | null} old read for other lines, or by an older version; null: too many to compare
 * @property {number} painted
 * @property {number} no_paint
 * @property {number} paint_disagrees
 * @property {number} no_frame
 * @property {string} sentence
 */

/** @typedef {{used: boolean, items: MatchPaintJson[]}} DatasetPaintJson */

/** What was read of a dataset's pictures. @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<DatasetPaintJson>} */
export function getDatasetPaint(dataset, signal) {
	return request(`/datasets/${dataset}/paint`, { signal });
}

/** Read the pictures of a match, or of all. @param {number} dataset @param {string | null} match @returns {Promise<JobJson>} */
export function readDatasetPaint(dataset, match) {
	return request(`/datasets/${dataset}/paint`, { method: 'POST', body: match === null ? {} : { match }, key: idempotencyKey() });
}

/** Take the last reading back. @param {number} dataset @returns {Promise<JobJson>} */
export function revertPaint(dataset) {
	return request(`/datasets/${dataset}/paint`, { method: 'DELETE', key: idempotencyKey() });
}
