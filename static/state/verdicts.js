// @ts-check
/** Verdicts: shown and left behind at once, put back when the server refuses. */

import { signal } from '@preact/signals';

import { navigate } from '../lib/router.js';
import { doubt } from './advice.js';
import { conflict } from './conflict.js';
import { group, groupDocument, onRefused, settle, submit, submitVerdict } from './group.js';
import { frozen } from './return_group.js';
import { actions, did, didAgain, forget, forgetUndone, tookBack, undone } from './last_action.js';
import { batchId, currentId, goNext, query, queueAddress, returnTo, reviewAddress } from './navigation.js';
import { isMoving, nextOfBatch } from './leases.js';
import { announce, complain, explain, inform } from './notice.js';
import { outbox } from './outbox.js';
import { reasonText } from './reasons.js';
import { refuses } from './rights.js';
import { stagedIn } from './staging.js';
import { asking, focused } from './workspace.js';

/** @import {VerdictDone} from './last_action.js' */

/** The reason last used, for `X X`. */
export const lastReason = signal(/** @type {string | null} */ (null));

/** Whether nobody can have looked at a group: no view of it has a picture. @param {import('../api/types.js').GroupDocument} group */
export function isBlind(group) {
	return group.views.every(({ image }) => image === null);
}

/** Accept and go on; a group that fails a gate, or that has no picture, needs a note that says why. */
export function accept() {
	const group = groupDocument.value;
	if (!group) return;
	if (!group.solution) {
		explain('This group is not solved yet and cannot be accepted.');
		return;
	}
	if (!group.solution.passes || isBlind(group) || doubt(group.solution)) asking.value = 'override';
	else if (stagedIn(group).count > 0) asking.value = 'staged';
	else acceptAsSaved();
}

/** Accept the group as it is saved. */
export function acceptAsSaved() {
	decide('accepted', null, null);
}

/** Ask for the reason to reject. */
export function askReason() {
	if (groupDocument.value) asking.value = 'reason';
}

/** The view in hand, if it is one of its group. */
function viewInHand() {
	return group.value?.views.find(({ letter }) => letter === focused.value);
}

/** Ask for the reason to leave the view in hand out of its group. */
export function askViewReason() {
	const view = viewInHand();
	if (view && !view.included) explain(`View ${view.letter} is left out already.`);
	else if (view) asking.value = 'view';
}

/** Leave the view in hand out for a reason. @param {string} reason one of REASONS */
export function rejectView(reason) {
	if (reason === 'other') asking.value = 'viewNote';
	else leaveOut(reason, null);
}

/** Leave the view in hand out in the person's own words. @param {string} note */
export function rejectViewBecause(note) {
	leaveOut('other', note);
}

/** The reason is part of the edit, so that undo takes both back. @param {string} reason one of REASONS @param {string | null} note */
function leaveOut(reason, note) {
	const view = viewInHand();
	asking.value = null;
	if (!view) return;
	lastReason.value = reason;
	submit({ kind: 'include', view: view.key, included: false, reason, note });
	announce(`View ${view.letter} left out: ${reasonText({ reason, note })}.`);
}

/** @param {string} reason one of REASONS */
export function reject(reason) {
	if (reason === 'other') {
		asking.value = 'note';
		return;
	}
	decide('rejected', reason, null);
}

/** Come back to this group later. */
export function defer() {
	decide('deferred', null, null);
}

/** The answer to what was asked. @param {string} note */
export function answer(note) {
	if (asking.value === 'override') decide('accepted', null, note);
	else decide('rejected', 'other', note);
}

/** Leave without a verdict. */
export function cancelAsking() {
	asking.value = null;
}

/** @param {string} state @param {string | null} reason @param {string | null} note */
function decide(state, reason, note) {
	const at = groupDocument.value;
	if (!at || isMoving.value) return;
	if (refuses('review', at.dataset.name)) return;
	if (frozen.value) {
		asking.value = null;
		complain(frozen.value);
		return;
	}
	if (conflict.value) {
		explain('First resolve the conflict: choose which version to keep.');
		return;
	}
	asking.value = null;
	if (reason) lastReason.value = reason;
	settle();
	const given = { state, reason, note };
	const before = group.value?.verdict ?? at.verdict;
	const key = submitVerdict(given);
	if (key === null) return;
	did({ kind: 'verdict', dataset: at.dataset.name, group: at.id, number: at.number, given, before, key });
	announce(`Group ${at.number} ${state}.`);
	leave(at.dataset.name);
}

/** Verdicts that the server has refused. */
let refusals = 0;

/** On to the next group, or back to the queue when that was the last one. @param {string} dataset */
async function leave(dataset) {
	const before = refusals;
	if (batchId.value !== null) {
		await nextOfBatch(() => refusals === before);
		return;
	}
	if (await goNext(() => refusals === before)) return;
	inform('That was the last group of this queue.', {
		label: 'Back to the queue', run: () => navigate(queueAddress(dataset, query.value)),
	});
}

/** As it is by now: the server may have answered meanwhile. @param {import('./last_action.js').Action[]} list @param {VerdictDone} action */
function presently(list, action) {
	return list.find((one) => one.kind === 'verdict' && one.key !== undefined && one.key === action.key) ?? action;
}

/** Take a verdict of this window back, and return to its group. @param {VerdictDone} before */
export async function undoVerdict(before) {
	const isThere = await returnTo(before.group);
	const action = /** @type {VerdictDone} */ (presently(actions.value, before));
	forget(action);
	if (!isThere || !group.value) return;
	const { state, reason, at } = group.value.verdict;
	// While it is on its way, it is the server that knows when it was given.
	const isNewest = state === action.given.state && reason === action.given.reason && (isUnsent(action) || at === action.at);
	if (!isNewest) {
		complain(`Group ${action.number} was reviewed again since; the new verdict stays.`);
		return;
	}
	if (action.key && submitVerdict(action.before, { field: 'undo_of', key: action.key, at: action.at })) {
		tookBack(action);
		announce(`The verdict on group ${action.number} was undone.`);
	}
}

/** Give a verdict again that was taken back, on its group. @param {VerdictDone} before */
export async function redoVerdict(before) {
	if (!(await returnTo(before.group)) || !group.value) return;
	const action = /** @type {VerdictDone} */ (presently(undone.value, before));
	const { state, reason } = group.value.verdict;
	if (state !== action.before.state || reason !== action.before.reason) {
		forgetUndone(action);
		complain(`Group ${action.number} was reviewed since; the new verdict stays.`);
		return;
	}
	if (!action.key || !(action.at || isUnsent(action))) {
		forgetUndone(action);
		complain(`The verdict on group ${action.number} cannot be redone any more; give it again.`);
		return;
	}
	const key = submitVerdict(action.given, { field: 'redo_of', key: action.key, at: action.at });
	if (key === null) return;
	didAgain(action, { ...action, key, at: undefined });
	announce(`Group ${action.number} ${action.given.state} again.`);
}

/** Whether the server has not answered a verdict yet. @param {VerdictDone} action */
function isUnsent({ key }) {
	return outbox.value.some((item) => item.id === key);
}

// A verdict that was refused brings its group back to the screen; the notice says why.
onRefused(({ id: key, verdict, turn, group: id }) => {
	if (!verdict) return;
	refusals += 1;
	const lost = new Set([key, turn?.field === 'undo_of' ? turn.key : key]);
	for (const action of [...actions.value, ...undone.value]) {
		if (action.kind !== 'verdict' || !action.key || !lost.has(action.key)) continue;
		forget(action);
		forgetUndone(action);
	}
	if (currentId() !== id) navigate(reviewAddress(id));
});
