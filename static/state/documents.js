// @ts-check
/** Groups as the server last gave them, and those that come next. */

import { getGroup } from '../api/client.js';
import { Kept } from '../lib/kept.js';
import { loadImage } from './images.js';

/** @import {GroupDocument} from '../api/types.js' */

/** @type {Kept<number, GroupDocument>} */
const documents = new Kept(24);
/** @type {Map<number, Promise<GroupDocument>>} */
const loading = new Map();

/** @param {number} id @returns {GroupDocument | undefined} */
export function known(id) {
	return documents.get(id);
}

/** Groups of which something was told while they are read: the answer may be older than that. @type {Set<number>} */
const outdated = new Set();

/** Something was told of a group: an answer that is on its way no longer counts. @param {number} id */
export function outdate(id) {
	if (loading.has(id)) outdated.add(id);
}

/** Read a group again before it is shown. @param {number} id */
export function forget(id) {
	documents.delete(id);
	outdate(id);
}

/**
 * Read every group but this one again before it is shown.
 *
 * @param {number | null} id @param {string | null} [dataset] only groups of that one
 */
export function forgetOthers(id, dataset = null) {
	for (const [other, { dataset: of }] of documents) if (other !== id && (dataset === null || of.name === dataset)) forget(other);
	// Of which dataset a group is that is still on its way, nobody knows yet.
	for (const other of loading.keys()) if (other !== id) outdate(other);
}

/** Answers to writes, by group: what was asked before one knows less than it. @type {Map<number, number>} */
const answers = new Map();

/** Remember what the server answered to a write. @param {GroupDocument} document */
export function rememberAnswer(document) {
	answers.set(document.id, (answers.get(document.id) ?? 0) + 1);
	documents.set(document.id, document);
}

/** @param {number} id @returns {Promise<GroupDocument>} */
export function load(id) {
	const present = loading.get(id);
	if (present) return present;
	const request = read(id).finally(() => loading.delete(id));
	loading.set(id, request);
	return request;
}

/** @param {number} id @returns {Promise<GroupDocument>} */
async function read(id) {
	const before = answers.get(id);
	outdated.delete(id);
	const document = await getGroup(id);
	const newer = answers.get(id) === before ? undefined : known(id);
	if (newer) return newer;
	if (outdated.has(id)) return read(id);
	documents.set(document.id, document);
	return document;
}

/**
 * Load groups and their frames before anybody asks; a failure shows when somebody does.
 *
 * @param {number[]} ids
 */
export async function prefetch(ids) {
	for (const id of ids) {
		try {
			const document = known(id) ?? (await load(id));
			await Promise.allSettled(document.views.map((view) => view.image && loadImage(view.image)));
		} catch {
			return;
		}
	}
}
