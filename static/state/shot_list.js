// @ts-check
/** The shots of a recording as they are changed: at once here, then on the server. */

import { signal } from '@preact/signals';

import { ApiError } from '../api/problem.js';
import { getShots, putShots } from '../api/recordings.js';
import { announce, complain, explain } from './notice.js';

/** @import {Shot} from '../api/recordings.js' */
/** @typedef {{items: Shot[], etag: string}} Shots */

/** The list of shots of a recording, and what changes it. @param {number} id */
export function makeShotList(id) {
	/** As shown; null until it is known. */
	const list = signal(/** @type {Shots | null} */ (null));
	/** Why it cannot be shown. */
	const error = signal(/** @type {ApiError | null} */ (null));
	/** What undo brings back, the newest last. @type {Shot[][]} */
	let before = [];
	let sending = Promise.resolve();
	/** What was sent for builds on what was sent before: where that fails a new turn begins. */
	let turn = 0;

	/** @param {() => boolean} isWanted whether the answer still counts when it comes */
	async function ask(isWanted) {
		try {
			const answer = await getShots(id);
			if (!isWanted()) return;
			list.value = answer;
			error.value = null;
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			if (isWanted()) error.value = problem;
		}
	}

	/** Read the list again, once what is on its way has arrived; what is changed until the answer comes is newer than it. */
	async function read() {
		for (let last = null; last !== sending;) {
			last = sending;
			await last;
		}
		const present = list.value;
		await ask(() => list.value === present);
	}

	/** @param {Shot[]} items @param {string} told once they are saved */
	function send(items, told) {
		if (!list.value) return;
		list.value = { items, etag: list.value.etag };
		const mine = turn;
		sending = sending.then(async () => {
			if (mine !== turn) return;
			try {
				const saved = await putShots(id, items, list.value?.etag ?? '');
				// What was changed meanwhile is on its way.
				const newest = list.value;
				announce(told);
				if (newest) list.value = { items: newest.items === items ? saved.items : newest.items, etag: saved.etag };
			} catch (problem) {
				if (!(problem instanceof ApiError)) throw problem;
				complain(problem.status === 412 ? 'The shots changed in another window or by another person; the page shows the new state.' : problem.message);
				await ask(() => true);
				// Also what was changed until the answer came was changed in the old list.
				turn += 1;
				before = [];
			}
		});
	}

	/** Keep the list as it is for undo. */
	function remember() {
		if (list.value) before.push(list.value.items);
	}

	/** @param {Shot[] | null} items null: nothing can be done here @param {string} told */
	function change(items, told) {
		if (!items || !list.value) return;
		remember();
		send(items, told);
	}

	function undo() {
		const last = before.pop();
		if (!last) { explain('There is nothing to undo.'); return; }
		send(last, 'Undone.');
	}

	return { list, error, read, change, undo, remember };
}
