// @ts-check
/** Every request to the server. The only file with `fetch`. */

import { signal } from '@preact/signals';

import { ApiError } from './problem.js';

/**
 * @import {
 *   DatasetJson, ExportJson, GroupDocument, GroupPage, Neighbours, SolutionJson
 * } from './types.js'
 */

const ROOT = '/api/v1';

/** Whether the server has refused a request because nobody is logged in. */
export const loggedOut = signal(false);

/** How often the server has refused a request because the person may not. */
export const forbidden = signal(0);

/** How often somebody has come in again. */
let entrances = 0;

/** Somebody has logged in: a refusal of what was asked before says nothing of them. */
export function cameIn() {
	if (loggedOut.value) entrances += 1;
	loggedOut.value = false;
}

/**
 * @param {number} status @param {any} body @param {number} [since] what `entrances` was when it was asked
 * @param {number} [retryAfter] @returns {ApiError}
 */
function refusal(status, body, since = entrances, retryAfter = 0) {
	if (status === 401 && since === entrances) loggedOut.value = true;
	if (status === 403) forbidden.value += 1;
	return new ApiError(status, body, retryAfter);
}

/** @typedef {{method?: string, body?: unknown, etag?: string, key?: string, signal?: AbortSignal, keepalive?: boolean}} RequestOptions   `keepalive`: it is sent also while the page goes away */

/**
 * @param {string} path below the API's root, or absolute @param {RequestOptions} [options]
 * @returns {Promise<any>}
 */
export async function request(path, options) {
	return (await requestTagged(path, options)).json;
}

/**
 * The same with the ETag of what was answered, for what is replaced as a whole, and whether it is
 * what an earlier sending of the same request was answered.
 *
 * @param {string} path @param {RequestOptions} [options]
 * @returns {Promise<{json: any, etag: string, replayed: boolean}>}
 */
export async function requestTagged(path, { method = 'GET', body, etag, key, signal, keepalive } = {}) {
	/** @type {Record<string, string>} */
	const headers = { accept: 'application/json' };
	if (body !== undefined) headers['content-type'] = 'application/json';
	if (etag) headers['if-match'] = etag;
	if (key) headers['idempotency-key'] = key;
	const since = entrances;
	let response;
	try {
		response = await fetch(path.startsWith('/api/') ? path : ROOT + path, {
			method, headers, signal, keepalive, body: body === undefined ? undefined : JSON.stringify(body),
		});
	} catch (error) {
		if (signal?.aborted) throw error;
		throw new ApiError(0, null);
	}
	const json = await bodyOf(response, signal);
	const { headers: said } = response;
	// A date in its place is not a number, and not honoured.
	if (!response.ok) throw refusal(response.status, json, since, Number(said.get('retry-after')) || 0);
	return { json, etag: said.get('etag') ?? '', replayed: said.get('idempotency-replayed') === 'true' };
}

/** The JSON of an answer; null where it has none. @param {Response} response @param {AbortSignal} [signal] @returns {Promise<any>} */
async function bodyOf(response, signal) {
	try {
		return await response.json();
	} catch (error) {
		// Its reader has gone, or the connection ended amid it: that is no answer.
		if (signal?.aborted) throw error;
		if (response.ok && !(error instanceof SyntaxError)) throw new ApiError(0, null);
		return null;
	}
}

/** A frame, as it lies on the server. @param {string} url absolute @returns {Promise<Blob>} */
export async function getFrame(url) {
	const since = entrances;
	const response = await fetch(url);
	if (!response.ok) throw refusal(response.status, null, since);
	return response.blob();
}

/** @param {Record<string, string | number | boolean | null | undefined>} values @returns {string} "?…", or "" */
export function queryText(values) {
	const search = new URLSearchParams();
	for (const [name, value] of Object.entries(values)) {
		if (value !== null && value !== undefined && value !== '') search.set(name, String(value));
	}
	const text = search.toString();
	return text ? `?${text}` : '';
}

/** A key that lets the server recognise the same request sent twice. */
export function idempotencyKey() {
	const bytes = crypto.getRandomValues(new Uint8Array(16));
	return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** @returns {Promise<{items: DatasetJson[]}>} */
export function getDatasets() {
	return request('/datasets');
}

/** @param {number} dataset @param {string} q @param {AbortSignal} [signal] @returns {Promise<any>} */
export function getSummary(dataset, q, signal) {
	return request(`/datasets/${dataset}/summary${queryText({ q })}`, { signal });
}

/**
 * @param {{dataset: string, q: string, limit: number, from?: number}} options `from`: the place of the first row
 * @param {AbortSignal} [signal]
 * @returns {Promise<GroupPage>} as the list is at this moment
 */
export function getGroups(options, signal) {
	return request(`/groups${queryText(options)}`, { signal });
}

/** @param {number} id @returns {Promise<GroupDocument>} */
export function getGroup(id) {
	return request(`/groups/${id}`);
}

/** @param {number} id @param {string} q @returns {Promise<Neighbours>} */
export function getNeighbours(id, q) {
	return request(`/groups/${id}/neighbours${queryText({ q })}`);
}

/** @typedef {{offset: number, label: string, image: string}} NeighbourFrame   offset: frames later */

/** The frames before and after that of a view. @param {string} address @returns {Promise<{items: NeighbourFrame[], sentence: string | null}>} */
export function getFramesAround(address) {
	return request(address);
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

/** @typedef {{dataset: string, format: string, all: boolean, boxes: string, images?: string, views?: string, version?: string | number | null}} ExportRequest */

/**
 * @param {ExportRequest} body
 * @returns {Promise<ExportJson>}
 */
export function postExport(body) {
	return request('/exports', { method: 'POST', body, key: idempotencyKey() });
}

/** @param {string | number} id @returns {Promise<ExportJson>} */
export function getExport(id) {
	return request(`/exports/${id}`);
}

/**
 * Send a file as it is. `fetch` cannot tell how far an upload is, hence the older interface.
 *
 * @param {string} path below the API's root @param {Blob} file
 * @param {(share: number) => void} progress @param {AbortSignal} [signal] @param {'POST' | 'PATCH'} [method]
 * @returns {Promise<any>}
 */
export function upload(path, file, progress, signal, method = 'POST') {
	return new Promise((resolve, reject) => {
		const sending = new XMLHttpRequest();
		sending.open(method, ROOT + path);
		sending.setRequestHeader('accept', 'application/json');
		sending.setRequestHeader('content-type', 'application/octet-stream');
		sending.responseType = 'json';
		sending.upload.onprogress = ({ loaded, total }) => progress(total ? loaded / total : 0);
		sending.onload = () => {
			if (sending.status < 400) resolve(sending.response);
			else reject(refusal(sending.status, sending.response));
		};
		sending.onerror = () => reject(new ApiError(0, null));
		sending.onabort = () => reject(signal?.reason);
		signal?.addEventListener('abort', () => sending.abort(), { once: true });
		sending.send(file);
	});
}

/** A file of the application itself. @param {string} url absolute @returns {Promise<any>} its JSON */
export async function getOwn(url) {
	const response = await fetch(url);
	if (!response.ok) throw new ApiError(response.status, null);
	return response.json();
}
