// @ts-check
/** Requests about the painted lines that a frame shows. */

import { request } from './client.js';

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

/** Lines for a view that has none. @param {number} view @param {AbortSignal} [signal] @returns {Promise<ProposalJson>} */
export function proposeLines(view, signal) {
	return request(`/views/${view}/propose`, { method: 'POST', signal });
}
