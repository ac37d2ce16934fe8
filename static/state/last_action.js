// @ts-check
/** What the person did in this window, the newest last, so that undo takes back that; it outlives a reload. */

import { stored } from '../lib/storage.js';

/** @typedef {{state: string, reason: string | null, note: string | null}} Said */
/** @typedef {{kind: 'edit', dataset: string, group: number, number: number, times: number}} EditDone   `times` in a row */
/** @typedef {{kind: 'verdict', dataset: string, group: number, number: number, given: Said, before: Said, key?: string, at?: string}} VerdictDone   `key`: of its write; `at`: when the server has it from */
/** @typedef {{kind: 'batch', dataset: string, batch: number, text: string}} BatchDone */
/** @typedef {{kind: string, view: string | null, marking: string | null, suggested: string | null, number: number | null}} FindingName */
/** @typedef {{kind: 'dismissal', dataset: string, group: number, number: number, finding: FindingName, dismissed: boolean}} DismissalDone */
/** @typedef {{kind: 'follow', dataset: string, from: string, text: string, items: {group: number, view: number, etag: string, box: number[]}[]}} FollowDone   balls that were followed from a group; `etag`: of their groups as this left them */
/** @typedef {EditDone | VerdictDone | BatchDone | DismissalDone | FollowDone} Action */

const KEPT = 100;

export const actions = stored('actions', /** @type {Action[]} */ ([]), 'sessionStorage');

/** @param {readonly Action[]} before @param {Action} action @returns {Action[]} edits of one group in a row are one entry */
export function withAction(before, action) {
	const last = before.at(-1);
	if (action.kind === 'edit' && last?.kind === 'edit' && last.group === action.group) {
		return [...before.slice(0, -1), { ...action, times: last.times + action.times }];
	}
	return [...before.slice(1 - KEPT), action];
}

/** What was taken back and can be done again, the last one last. */
export const undone = stored('undone', /** @type {Action[]} */ ([]), 'sessionStorage');

/** Remember what was done; what was taken back before stays so. @param {Action} action */
export function did(action) {
	actions.value = withAction(actions.value, action);
	undone.value = [];
}

/** It was taken back. @param {Action} action */
export function tookBack(action) {
	undone.value = [...undone.value.slice(1 - KEPT), action];
}

/** What was taken back is done again. @param {Action} action @param {Action} [as] what it is called now, where that is something else */
export function didAgain(action, as) {
	if (!undone.value.includes(action)) return;
	undone.value = undone.value.filter((other) => other !== action);
	actions.value = withAction(actions.value, as ?? action);
}

/** The server has a verdict: by its time it is named where it is undone or redone. @param {string} key of its write @param {string} at */
export function learnTime(key, at) {
	/** @param {Action} action @returns {Action} */
	const timed = (action) => (action.kind === 'verdict' && action.key === key ? { ...action, at } : action);
	for (const list of [actions, undone]) {
		if (list.value.some((action) => action.kind === 'verdict' && action.key === key)) list.value = list.value.map(timed);
	}
}

/** It cannot be done again, or was done again elsewhere. @param {Action} action */
export function forgetUndone(action) {
	const rest = undone.value.filter((other) => other !== action && !isSameBatch(other, action));
	if (rest.length < undone.value.length) undone.value = rest;
}

/** The edit of a group that was taken back last never reached the server: there is nothing to do again. @param {number} group */
export function forgetUndoneEdit(group) {
	const last = undone.value.findLast((action) => action.kind === 'edit' && action.group === group);
	if (last) undone.value = undone.value.filter((other) => other !== last);
}

/** It was taken back, or cannot be. @param {Action} action */
export function forget(action) {
	const rest = actions.value.filter((other) => other !== action && !isSameBatch(other, action));
	if (rest.length < actions.value.length) actions.value = rest;
}

/** A batch is taken back from its list too. @param {Action} one @param {Action} other */
function isSameBatch(one, other) {
	return one.kind === 'batch' && other.kind === 'batch' && one.batch === other.batch;
}

/** One edit of a group was taken back. @param {number} group */
export function forgetEdit(group) {
	const last = actions.value.findLast((action) => action.kind === 'edit' && action.group === group);
	if (last?.kind !== 'edit') return;
	const at = actions.value.lastIndexOf(last);
	const rest = last.times > 1 ? [{ ...last, times: last.times - 1 }] : [];
	actions.value = actions.value.toSpliced(at, 1, ...rest);
}

/** What was taken back last in a dataset. @param {readonly Action[]} back @param {string | undefined} dataset */
export function nextAgain(back, dataset) {
	return back.findLast((action) => action.dataset === dataset);
}

/**
 * What undo takes back next: of the dataset on screen, for nobody expects to leave it.
 *
 * @param {readonly Action[]} done @param {number | null} group on screen
 * @param {boolean} edited whether that has an edit to take back, whoever made it
 * @param {string | undefined} dataset
 * @returns {Action | 'here' | null} `here`: the last edit of the group on screen
 */
export function nextBack(done, group, edited, dataset) {
	for (const action of done.toReversed()) {
		if (action.dataset !== dataset) continue;
		if (action.kind !== 'edit') return action;
		if (edited) return 'here';
		// One of this group that cannot be taken back any more is passed over.
		if (action.group !== group) return action;
	}
	return edited ? 'here' : null;
}
