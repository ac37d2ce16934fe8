// @ts-check
/** Requests about the exports there are. */

import { queryText, request } from './client.js';

/** @import {Counts} from './types.js' */

/**
 * @typedef {object} ExportRow
 * @property {string} id
 * @property {'waiting' | 'running' | 'ready' | 'failed' | 'cancelled' | 'gone' | 'expired'} status
 * @property {{dataset: string, format: string, all: boolean, version: string | number | null, boxes: string, images: string}} request
 * @property {string} created
 * @property {string | null} expires when its file is deleted
 * @property {string | null} content
 * @property {number | null} bytes
 * @property {Counts | null} counts
 * @property {Counts | null} left_out
 * @property {string[] | null} missing_images
 * @property {string | null} incomplete what the files lack before they can be used
 * @property {string | null} error
 */

/** In which formats a dataset, or a version of it, can be exported. @param {number} dataset @param {{version?: number}} options @param {AbortSignal} [signal] @returns {Promise<{items: {format: string, possible: boolean, reason: string | null, hint: string | null, options: string[]}[]}>} */
export function getFormats(dataset, options, signal) {
	return request(`/datasets/${dataset}/export-formats${queryText(options)}`, { signal });
}

/** @param {{dataset?: string, limit?: number, cursor?: string | null}} options @param {AbortSignal} [signal] @returns {Promise<{items: ExportRow[], next: string | null}>} */
export function getExports(options, signal) {
	return request(`/exports${queryText(options)}`, { signal });
}

/** @param {string} id */
export function deleteExport(id) {
	return request(`/exports/${id}`, { method: 'DELETE' });
}
