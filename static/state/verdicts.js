// @ts-check
/** Verdicts: shown and left behind at once, put back when the server refuses. */

import { signal } from '@preact/signals';

import { navigate } from '../lib/router.js';
import { doubt } from './advice.js';
import { conflict } from './conflict.js';
import { group, groupDocument, onRefused, settle, submit, submitVerdict } from './group.js';
import { frozen } from './return_group.js';
import { actions, did, didAgain, forget, forgetUndone, tookBack } from './last_action.js';
import { batchId, currentId, goNext, query, queueAddress, returnTo, reviewAddress } from './navigation.js';
import { isMoving, nextOfBatch } from './leases.js';
import { announce, complain, inform } from './notice.js';
import { reasonText } from './reasons.js';
import { refuses } from './rights.js';
import { asking, focused } from './workspace.js';

/** @import {VerdictDone} from './last_action.js' */

/** The server takes no longer note. */
const MAX_NOTE = 2000;

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
		announce('This group is not solved yet and cannot be accepted.');
		return;
	}
	if (!group.solution.passes || isBlind(group) || doubt(group.solution)) asking.value = 'override';
	else decide('accepted', null, null);
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
	if (view && !view.included) announce(`View ${view.letter} is left out already.`);
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
	const group = groupDocument.value;
	if (!group || isMoving.value) return;
	if (refuses('review', group.dataset.name)) return;
	if (frozen.value) {
		asking.value = null;
		complain(frozen.value);
		return;
	}
	if (conflict.value) {
		announce('First resolve the conflict: choose which version to keep.');
		return;
	}
	asking.value = null;
	if (reason) lastReason.value = reason;
	settle();
	const { state: was, reason: because, note: said } = group.verdict;
	did({
		kind: 'verdict', dataset: group.dataset.name, group: group.id, number: group.number, given: { state, reason, note },
		before: { state: was, reason: because, note: said },
	});
	submitVerdict({ state, reason, note });
	announce(`Group ${group.number} ${state}.`);
	leave(group.dataset.name);
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

/** Keep a note with the verdict that the group has; the group stays on screen. @param {string} text */
export function addNote(text) {
	const present = group.value?.verdict;
	if (!present || refuses('review', group.value?.dataset.name)) return;
	asking.value = null;
	const note = [present.note, text].filter(Boolean).join('\n').slice(0, MAX_NOTE);
	submitVerdict({ state: present.state, reason: present.reason, note });
	announce('Note saved.');
}

/** Take a verdict of this window back, and return to its group. @param {VerdictDone} action */
export async function undoVerdict(action) {
	forget(action);
	if (!(await returnTo(action.group)) || !group.value) return;
	const { state, reason } = group.value.verdict;
	if (state !== action.given.state || reason !== action.given.reason) {
		complain(`Group ${action.number} was reviewed again since; the new verdict stays.`);
		return;
	}
	submitVerdict(action.before);
	tookBack(action);
	announce(`The verdict on group ${action.number} was undone.`);
}

/** Give a verdict again that was taken back, on its group. @param {VerdictDone} action */
export async function redoVerdict(action) {
	if (!(await returnTo(action.group)) || !group.value) return;
	const { state, reason } = group.value.verdict;
	if (state !== action.before.state || reason !== action.before.reason) {
		forgetUndone(action);
		complain(`Group ${action.number} was reviewed since; the new verdict stays.`);
		return;
	}
	didAgain(action);
	submitVerdict(action.given);
	announce(`Group ${action.number} ${action.given.state} again.`);
}

// A verdict that was refused brings its group back to the screen; the notice says why.
onRefused(({ verdict, group: id }) => {
	if (!verdict) return;
	refusals += 1;
	const given = actions.value.findLast((action) => action.kind === 'verdict' && action.group === id);
	if (given) forget(given);
	if (currentId() !== id) navigate(reviewAddress(id));
});
