// @ts-check
/** Requests that bring files in: uploads, folders, imports. */

import { idempotencyKey, queryText, request, upload } from './client.js';

/** @import {JobJson} from './jobs.js' */

/** @typedef {{id: string, name: string, bytes: number, size: number, created: string, kept: boolean, format: string | null}} UploadJson   `bytes` of `size` are there; `format`: what it most likely holds */
/** @typedef {{upload: string} | {folder: string}} ImportSource */
/** @typedef {{dataset: string, format: string, source: ImportSource, options: {[name: string]: any}, dry_run: boolean, policy?: string}} ImportRequest   policy: of a dataset that is made; without one it follows the pictures */

/**
 * @typedef {object} ImportReport
 * @property {'complete' | 'partial' | 'nothing'} [outcome]
 * @property {number} read
 * @property {number} imported
 * @property {number} new
 * @property {number} changed
 * @property {number} unchanged
 * @property {{file: string, record: string | null, field: string | null, problem: string}[]} skipped
 * @property {number} findings
 * @property {number} [without_picture] groups of which no view has a picture
 * @property {{[name: string]: number}} [counts]
 * @property {number} [more_skipped]
 * @property {any[]} [remarks]
 * @property {number | null} [rig_job] proposes how static cameras fit each other
 * @property {number | null} [paint_job] reads the paint of what is new
 * @property {number | null} [proposals_job] proposes cameras for pictures alone
 */

/** @typedef {{name: string, path: string, folder: boolean}} FolderEntry */
/** @typedef {{path: string, format: string | null, items: FolderEntry[], more: boolean}} FolderJson */

/** @param {File} file @param {(share: number) => void} progress @param {AbortSignal} [signal] @returns {Promise<UploadJson>} */
export function postUpload(file, progress, signal) {
	return upload(`/uploads${queryText({ name: file.name })}`, file, progress, signal);
}

/** Begin to send a file in parts, or find how far the same file came. @param {File} file @param {AbortSignal} [signal] @returns {Promise<UploadJson>} */
export function beginUpload(file, signal) {
	const query = queryText({ name: file.name, size: file.size, mark: file.lastModified });
	return upload(`/uploads${query}`, new Blob([]), () => {}, signal);
}

/** @param {string} id @param {number} offset @param {Blob} part @param {(share: number) => void} progress @param {AbortSignal} [signal] @returns {Promise<UploadJson>} */
export function sendPart(id, offset, part, progress, signal) {
	return upload(`/uploads/${id}${queryText({ offset })}`, part, progress, signal, 'PATCH');
}

/** @param {string} id */
export function deleteUpload(id) {
	return request(`/uploads/${id}`, { method: 'DELETE' });
}

/** One's own uploads. @param {AbortSignal} [signal] @returns {Promise<{items: UploadJson[], days: number}>} */
export function getUploads(signal) {
	return request('/uploads', { signal });
}

/** How much room uploads have, and how much of it one's own take. @param {AbortSignal} [signal] @returns {Promise<{max_bytes: number, days: number, used_bytes: number, quota_bytes: number | null}>} */
export function getUploadRoom(signal) {
	return request(`/uploads${queryText({ limit: '1' })}`, { signal });
}

/** The folders that the operator allowed, or what lies in one. @param {string} path "": the allowed ones @param {AbortSignal} [signal] @returns {Promise<FolderJson>} */
export function getFolders(path, signal) {
	return request(`/imports/folders${queryText({ path })}`, { signal });
}

/** @param {ImportRequest} body @returns {Promise<JobJson>} */
export function postImport(body) {
	return request('/imports', { method: 'POST', body, key: idempotencyKey() });
}
