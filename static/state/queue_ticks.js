// @ts-check
/** Ticked rows of the queue: some of those that match, or all but some. */

import { effect, signal } from '@preact/signals';

import { ApiError } from '../api/problem.js';
import { getGroupIds } from '../api/queue.js';
import { count } from '../lib/format.js';
import { announce, complain } from './notice.js';
import { queueKey, withField } from './query.js';
import { activeRow, queue } from './queue.js';
import { idsBetween, rowAt } from './queue_pages.js';

/** @typedef {{readonly all: boolean, readonly ids: ReadonlySet<number>}} Ticks   `all`: every row that matches but `ids`; else `ids` alone */

/** @type {Ticks} */
export const NONE = { all: false, ids: new Set() };
/** @type {Ticks} */
const ALL = { all: true, ids: new Set() };

export const ticks = signal(NONE);

/** @param {Ticks} from @param {number} id */
export function isTicked({ all, ids }, id) {
	return ids.has(id) !== all;
}

/** The same with some rows ticked, or not. @param {Ticks} from @param {readonly number[]} rows @param {boolean} on @returns {Ticks} */
export function withRows({ all, ids }, rows, on) {
	const next = new Set(ids);
	for (const id of rows) {
		if (on === all) next.delete(id);
		else next.add(id);
	}
	return { all, ids: next };
}

/** @param {Ticks} from @param {number} total rows that match */
export function countOf({ all, ids }, total) {
	return all ? Math.max(total - ids.size, 0) : ids.size;
}

/** The query that finds what is ticked. @param {Ticks} from @param {string} q that of the rows */
export function queryOf({ all, ids }, q) {
	const listed = [...ids].sort((a, b) => a - b).join(',');
	// Rows that do not match any more are not decided about: somebody may have judged them meanwhile.
	if (!all) return withField(q, 'sort', [`id:${listed}`]);
	return withField(q, 'sort', ids.size > 0 ? [`-id:${listed}`] : []);
}

/** What a range begins with, and the rows it has reached. @type {{index: number, id: number, on: boolean, before: Ticks, reach: number} | null} */
let range = null;

/** Nothing is ticked any more. */
export function clearTicks() {
	range = null;
	ticks.value = NONE;
}

/** Tick a row, or untick it; ranges begin there. @param {number} index */
export function turnTick(index) {
	const row = rowAt(queue.value.pages, index);
	if (!row) return;
	const before = ticks.value;
	const on = !isTicked(before, row.id);
	range = { index, id: row.id, on, before, reach: index };
	ticks.value = withRows(before, [row.id], on);
}

/** Give every row from where the range began up to this one what the first one got. @param {number} index */
export async function tickTo(index) {
	if (!range || rowAt(queue.value.pages, range.index)?.id !== range.id) range = null;
	if (!range) {
		turnTick(index);
		return;
	}
	const mine = range;
	mine.reach = index;
	const ids = await idsOf(Math.min(mine.index, index), Math.max(mine.index, index));
	// Meanwhile the range may have gone on, or the rows may be others.
	if (ids && range === mine && mine.reach === index) ticks.value = withRows(mine.before, ids, mine.on);
}

/** Tick the active row and the one beside it, and go there. @param {1 | -1} step */
export function extendTicks(step) {
	const from = activeRow.value;
	const to = Math.max(0, Math.min(queue.value.total - 1, from + step));
	if (range?.reach !== from) {
		const row = rowAt(queue.value.pages, from);
		if (!row) return;
		range = { index: from, id: row.id, on: true, before: ticks.value, reach: from };
	}
	activeRow.value = to;
	tickTo(to);
}

/** Tick all that match, or nothing. */
export function turnAll() {
	range = null;
	ticks.value = countOf(ticks.value, queue.value.total) === queue.value.total ? NONE : ALL;
}

/** @param {number} first @param {number} last @returns {Promise<readonly number[] | null>} null when they cannot be told */
async function idsOf(first, last) {
	const { dataset, q, pages, shown } = queue.value;
	const here = idsBetween(pages, first, last);
	if (here) return here;
	try {
		const { ids } = await getGroupIds({ dataset, q, from: first, limit: last - first + 1 });
		return queue.value.shown === shown ? ids : null;
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`These rows cannot be ticked: ${error.message}`);
		return null;
	}
}

let tickedFor = '';
// Ticks belong to what matches, in whatever order: others would be decided unseen.
effect(() => {
	const { dataset, q, shown } = queue.value;
	if (shown === '' || shown !== queueKey(dataset, q)) return;
	const key = queueKey(dataset, withField(q, 'sort', []));
	if (key !== tickedFor) clearTicks();
	tickedFor = key;
});

let said = 0;
effect(() => {
	const number = countOf(ticks.value, queue.value.total);
	if (number !== said) announce(number === 0 ? 'Nothing is ticked.' : `${count(number)} ticked.`);
	said = number;
});
