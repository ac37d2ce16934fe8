// @ts-check
/** The queue follows what happens to its groups elsewhere. */

import { getGroups } from '../api/client.js';
import { listen } from '../api/events.js';
import { ApiError } from '../api/problem.js';
import { openQueue, queue, recount, replaceRows } from './queue.js';

/** @import {DatasetJson, GroupRow} from '../api/types.js' */

const PAUSE = 400;
/** More than this many at once, and the whole queue is read again. */
const FEW = 8;

/**
 * Keep the rows of a dataset true until the returned function is called.
 *
 * @param {DatasetJson} dataset
 * @returns {() => void}
 */
export function followQueue(dataset) {
	/** @type {Set<number>} */
	const changed = new Set();
	/** @type {ReturnType<typeof setTimeout> | undefined} */
	let timer;
	function later() {
		clearTimeout(timer);
		timer = setTimeout(() => {
			const ids = [...changed];
			changed.clear();
			refresh(dataset, ids).catch((error) => { if (!(error instanceof ApiError)) throw error; });
		}, PAUSE);
	}
	const stop = listen('group', (/** @type {{group: number, dataset: string}} */ event) => {
		if (event.dataset !== dataset.name) return;
		changed.add(event.group);
		later();
	});
	return () => {
		clearTimeout(timer);
		stop();
	};
}

/** @param {DatasetJson} dataset @param {number[]} ids */
async function refresh(dataset, ids) {
	const shown = queue.value.rows.filter((row) => ids.includes(row.id));
	if (shown.length > FEW) {
		await openQueue(dataset, queue.value.q);
		return;
	}
	const rows = await Promise.all(shown.map((row) => rowNow(dataset, row)));
	replaceRows(rows.filter((row) => row !== null));
	await recount(dataset);
}

/** @param {DatasetJson} dataset @param {GroupRow} row @returns {Promise<GroupRow | null>} */
async function rowNow(dataset, row) {
	const found = await getGroups({ dataset: dataset.name, q: `number:${row.number}`, cursor: null, limit: 1 });
	return found.items[0] ?? null;
}
