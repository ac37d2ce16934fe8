// @ts-check
/** Every request to the server. The only file with `fetch`. */

import { ApiError } from './problem.js';

/**
 * @import {
 *   DatasetJson, ExportJson, GroupDocument, GroupPage, Neighbours, SolutionJson
 * } from './types.js'
 */

const ROOT = '/api/v1';

/**
 * @param {string} path below the API's root, or absolute
 * @param {{method?: string, body?: unknown, etag?: string, key?: string, signal?: AbortSignal}} [options]
 * @returns {Promise<any>}
 */
async function request(path, { method = 'GET', body, etag, key, signal } = {}) {
	/** @type {Record<string, string>} */
	const headers = { accept: 'application/json' };
	if (body !== undefined) headers['content-type'] = 'application/json';
	if (etag) headers['if-match'] = etag;
	if (key) headers['idempotency-key'] = key;
	let response;
	try {
		response = await fetch(path.startsWith('/api/') ? path : ROOT + path, {
			method, headers, signal, body: body === undefined ? undefined : JSON.stringify(body),
		});
	} catch (error) {
		if (signal?.aborted) throw error;
		throw new ApiError(0, null);
	}
	const json = await response.json().catch(() => null);
	if (!response.ok) throw new ApiError(response.status, json);
	return json;
}

/** @param {Record<string, string | number | null | undefined>} values */
function query(values) {
	const search = new URLSearchParams();
	for (const [name, value] of Object.entries(values)) {
		if (value !== null && value !== undefined && value !== '') search.set(name, String(value));
	}
	const text = search.toString();
	return text ? `?${text}` : '';
}

/** A key that lets the server recognise the same request sent twice. */
function idempotencyKey() {
	const bytes = crypto.getRandomValues(new Uint8Array(16));
	return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** @returns {Promise<{items: DatasetJson[]}>} */
export function getDatasets() {
	return request('/datasets');
}

/** @param {number} dataset @param {string} q @param {AbortSignal} [signal] @returns {Promise<any>} */
export function getSummary(dataset, q, signal) {
	return request(`/datasets/${dataset}/summary${query({ q })}`, { signal });
}

/**
 * @param {{dataset: string, q: string, cursor: string | null, limit: number}} options
 * @param {AbortSignal} [signal]
 * @returns {Promise<GroupPage>}
 */
export function getGroups(options, signal) {
	return request(`/groups${query(options)}`, { signal });
}

/** @param {number} id @returns {Promise<GroupDocument>} */
export function getGroup(id) {
	return request(`/groups/${id}`);
}

/** @param {number} id @param {string} q @returns {Promise<Neighbours>} */
export function getNeighbours(id, q) {
	return request(`/groups/${id}/neighbours${query({ q })}`);
}

/**
 * One edit; the answer is the group as it is then.
 *
 * @param {{path: string, body: unknown}} edit
 * @param {string} etag
 * @returns {Promise<GroupDocument>}
 */
export function patch({ path, body }, etag) {
	return request(path, { method: 'PATCH', body, etag, key: idempotencyKey() });
}

/**
 * What the numbers would be; saves nothing.
 *
 * @param {number} id @param {unknown} body @param {AbortSignal} [signal]
 * @returns {Promise<{solution: SolutionJson}>}
 */
export function preview(id, body, signal) {
	return request(`/groups/${id}/preview`, { method: 'POST', body, signal });
}

/**
 * Take the last edit of a group back, or make it again.
 *
 * @param {'undo' | 'redo'} verb @param {number} id @param {string} etag
 * @returns {Promise<GroupDocument>}
 */
export function turnBack(verb, id, etag) {
	return request(`/groups/${id}/${verb}`, { method: 'POST', etag, key: idempotencyKey() });
}

/**
 * The same for a static camera; the answer is the group.
 *
 * @param {'undo' | 'redo'} verb @param {number} station @param {number} group
 * @param {string} etag of the station
 * @returns {Promise<GroupDocument>}
 */
export function turnBackStation(verb, station, group, etag) {
	const path = `/stations/${station}/${verb}${query({ group })}`;
	return request(path, { method: 'POST', etag, key: idempotencyKey() });
}

/**
 * @param {number} id
 * @param {{state: string, reason: string | null, note: string | null}} verdict
 * @param {string} etag
 * @returns {Promise<GroupDocument>}
 */
export function putVerdict(id, verdict, etag) {
	return request(`/groups/${id}/verdict`, { method: 'PUT', body: verdict, etag });
}

/**
 * @param {{dataset: string, format: string, all: boolean, boxes: string}} body
 * @returns {Promise<ExportJson>}
 */
export function postExport(body) {
	return request('/exports', { method: 'POST', body, key: idempotencyKey() });
}

/** @param {string | number} id @returns {Promise<ExportJson>} */
export function getExport(id) {
	return request(`/exports/${id}`);
}
