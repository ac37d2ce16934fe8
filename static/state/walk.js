// @ts-check
/**
 * A walk through a queue. Groups leave a queue such as `status:unreviewed` once they are judged, and
 * whoever counts what is left counts backwards: the walk keeps the queue as it was when it began.
 */

import { batch, computed, effect, signal } from '@preact/signals';

import { ApiError } from '../api/problem.js';
import { getGroupIds } from '../api/queue.js';
import { stored } from '../lib/storage.js';
import { groupDocument } from './group.js';
import { neighbours, query, recount } from './navigation.js';
import { outbox } from './outbox.js';
import { queueKey, withField, wordsOf } from './query.js';

/** @import {Neighbours} from '../api/types.js' */

/** @typedef {{key: string, total: number, ids: readonly number[]}} Walk   `ids`: the queue when the walk began, empty while it is not known */
/**
 * @typedef {object} Standing
 * @property {number | null} place from 1; null: the group is none of this queue
 * @property {number} total of the queue when the walk began
 * @property {number} done judged since
 * @property {number | null} left still to be judged; null where judged groups stay in the queue
 */

/** Longer queues are not kept; their places are counted from what is left. */
const MOST = 50_000;
/** Words that speak about verdicts: a judged group may leave such a queue. */
const OF_VERDICTS = /^-?(status|stale|reviewer|reason|fixed):/;

/** @type {Walk} */
const NOWHERE = { key: '', total: 0, ids: [] };
const walk = stored('walk', NOWHERE, 'sessionStorage');
/** Groups judged on this walk. */
const judged = stored('walk-done', /** @type {number[]} */ ([]), 'sessionStorage');

/** Go on with the walk, or begin one. @param {string} dataset @param {Neighbours & {id: number, q: string}} at */
function arrive(dataset, at) {
	const key = queueKey(dataset, at.q);
	const known = walk.peek();
	// A group that was not there when the walk began belongs to a new one.
	if (known.key === key && (at.index === null || known.ids.length === 0 || known.ids.includes(at.id))) return;
	batch(() => {
		walk.value = { key, total: at.total, ids: [] };
		judged.value = [];
	});
	// Nothing leaves a queue that nothing is asked of.
	if (withField(at.q, 'sort', []) !== '' && at.total <= MOST) remember(dataset, at, key);
}

/** Keep the queue as it is now. @param {string} dataset @param {Neighbours & {id: number, q: string}} at @param {string} key */
async function remember(dataset, at, key) {
	try {
		const { ids } = await getGroupIds({ dataset, q: at.q, from: 0, limit: MOST });
		if (walk.value.key !== key) return;
		// Who is quick has judged the first group before the answer is there.
		if (at.index !== null && !ids.includes(at.id)) ids.splice(at.index, 0, at.id);
		walk.value = { key, total: ids.length, ids };
	} catch (error) {
		// Places are then counted from what is left.
		if (!(error instanceof ApiError)) throw error;
	}
}

/** @param {number} id @param {boolean} is */
function mark(id, is) {
	const { ids } = walk.peek();
	if (ids.length > 0 && !ids.includes(id)) return;
	const known = judged.peek();
	if (known.includes(id) !== is) judged.value = is ? [...known, id] : known.filter((one) => one !== id);
}

effect(() => {
	const [at, group] = [neighbours.value, groupDocument.value];
	if (at && group?.id === at.id && at.q === query.value.trim()) arrive(group.dataset.name, at);
});

// Every verdict, taken back or refused, goes through the outbox and ends in the document.
effect(() => {
	for (const { group, verdict } of outbox.value) if (verdict) mark(group, verdict.state !== 'unreviewed');
});
effect(() => {
	const group = groupDocument.value;
	const waits = outbox.value.some((item) => item.group === group?.id && item.verdict);
	if (group && !waits && group.verdict.state === 'unreviewed') mark(group.id, false);
});

/** Whether verdicts have arrived since the server was asked how many groups are left. */
const outdated = signal(false);
let waited = false;

// A group's neighbours are asked for while the verdict on the one before is still on its way.
effect(() => {
	const waits = outbox.value.some(({ verdict }) => verdict);
	if (waited && !waits) outdated.value = true;
	waited = waits;
});
effect(() => {
	const at = neighbours.value;
	if (!outdated.value || !at || at.id !== groupDocument.value?.id) return;
	outdated.value = false;
	if (isLeft(at.q)) recount();
});

/** Whether judged groups may leave the queue. @param {string} q */
function isLeft(q) {
	return wordsOf(q).some((word) => OF_VERDICTS.test(word));
}

/** Where the group on screen stands; null until it is known. */
export const standing = computed(() => {
	const [at, group] = [neighbours.value, groupDocument.value];
	return at && group?.id === at.id ? standingOf(at, walk.value, judged.value, queueKey(group.dataset.name, at.q)) : null;
});

/**
 * @param {Neighbours & {id: number, q: string}} at @param {Walk} walked @param {readonly number[]} done @param {string} key
 * @returns {Standing}
 */
function standingOf(at, walked, done, key) {
	if (walked.key !== key) return { place: at.index === null ? null : at.index + 1, total: at.total, done: 0, left: null };
	const { ids, total } = walked;
	const known = ids.indexOf(at.id);
	const counted = at.index === null ? null : Math.min(total, at.index + 1 + done.length);
	const leaving = isLeft(at.q);
	return {
		place: known >= 0 ? known + 1 : ids.length > 0 ? null : leaving || at.index === null ? counted : at.index + 1,
		total: ids.length > 0 || leaving ? total : at.total,
		done: done.length,
		// Others may judge too.
		left: leaving ? Math.max(0, Math.min(total - done.length, at.total)) : null,
	};
}
