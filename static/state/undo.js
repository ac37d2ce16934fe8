// @ts-check
/** Undo and redo: through the server, so that they survive a reload. */

import { computed } from '@preact/signals';

import { navigate, page } from '../lib/router.js';
import { dataset } from './datasets.js';
import { groupDocument, lastStationOf, open, pending, settle, submitTurn } from './group.js';
import { actions, didAgain, forget, forgetEdit, nextAgain, nextBack, tookBack, undone } from './last_action.js';
import { returnTo, reviewAddress } from './navigation.js';
import { announce, complain, explain } from './notice.js';
import { discard, outbox } from './outbox.js';
import { busyWith, isAway, untilTakenUp, wake } from './sending.js';
import { redoVerdict, undoVerdict } from './verdicts.js';

/** @import {EditDone} from './last_action.js' */

const ownStation = computed(() => lastStationOf(groupDocument.value?.id));
/** The group that the page is about, in the review as in the calibration editor. */
const onScreen = computed(() => ('group' in page.value ? page.value.group : null));
/** Whether the group that is loaded has an edit to take back, whoever made it. */
const isEdited = computed(() => (
	Boolean(groupDocument.value?.can_undo) || ownStation.value !== null || pending.value.length > 0
));
/** The dataset that the page is about; while its first group loads, that of what was done last. */
const here = computed(() => {
	if (onScreen.value === null) return dataset.value?.name;
	return groupDocument.value?.dataset.name ?? actions.value.at(-1)?.dataset;
});
const next = computed(() => {
	const shown = onScreen.value === groupDocument.value?.id ? groupDocument.value : null;
	return nextBack(actions.value, onScreen.value, shown !== null && isEdited.value, here.value);
});
/** What undo would take back, in words; null when there is nothing. */
export const undoable = computed(() => {
	const action = next.value;
	if (action === null) return null;
	if (action === 'here') return 'Undo the last edit of this group';
	if (action.kind === 'batch' || action.kind === 'follow') return `Undo: ${action.text}`;
	if (action.kind === 'edit') return `Go back to group ${action.number} and undo its last edit`;
	if (action.kind === 'dismissal') return `${action.dismissed ? 'Reopen the finding' : 'Dismiss the finding again'} in group ${action.number}`;
	return `Undo the verdict on group ${action.number}`;
});
// A new edit leaves nothing to redo, though the server has not answered it yet.
const canRedoHere = computed(() => pending.value.length === 0 && (Boolean(groupDocument.value?.can_redo) || ownStation.value !== null));
/** What redo would do again, in words; null when there is nothing. */
export const redoable = computed(() => {
	const action = nextAgain(undone.value, here.value);
	if (!action) return canRedoHere.value ? 'Redo the undone edit of this group' : null;
	if (action.kind === 'batch' || action.kind === 'follow') return `Redo: ${action.text}`;
	if (action.kind === 'edit') return `Redo the undone edit of group ${action.number}`;
	if (action.kind === 'dismissal') return `${action.dismissed ? 'Dismiss the finding again' : 'Reopen the finding'} in group ${action.number}`;
	return `Redo the verdict on group ${action.number}`;
});

/** One after the other: the next one speaks about the group to which the last one led. */
let turn = Promise.resolve();

/** Take back what this window did last, wherever that was, else the last edit of this group, whoever made it. */
export function undo() {
	settle();
	turn = turn.then(undoOne, undoOne);
}

async function undoOne() {
	// What the page before this one did last may still wait for its answer.
	await untilTakenUp();
	const action = next.value;
	if (action === null) explain('Nothing to undo.');
	else if (action === 'here') undoHere();
	else if (action.kind === 'verdict') await undoVerdict(action);
	else if (action.kind === 'edit') await undoThere(action);
	else if (action.kind === 'dismissal') {
		// Findings are the review's: the queue opens without them.
		const { undoDismissal } = await import('./dismissals.js');
		await undoDismissal(action);
	}
	else if (action.kind === 'follow') {
		const { undoFollow } = await import('./follow.js');
		await undoFollow(action);
	}
	else {
		// Bulk verdicts are the queue's: the review screen opens without them.
		const { undoBatch } = await import('./queue_batches.js');
		await undoBatch(action);
	}
}

function undoHere() {
	const at = groupDocument.value;
	if (!at) return;
	if (isAway.value) {
		if (undoUnsent()) forgetEdit(at.id);
	} else {
		forgetEdit(at.id);
		tookBack({ kind: 'edit', dataset: at.dataset.name, group: at.id, number: at.number, times: 1 });
		submitTurn('undo');
	}
}

/** Return to a group and undo its last edit. @param {EditDone} action */
async function undoThere(action) {
	if (!(await returnTo(action.group))) return;
	if (isEdited.value) undoHere();
	else forget(action);
}

/** Do again what was taken back last, wherever that was, else the last undone edit of this group. */
export function redo() {
	settle();
	turn = turn.then(redoOne, redoOne);
}

async function redoOne() {
	const action = nextAgain(undone.value, here.value);
	if (action?.kind === 'verdict') await redoVerdict(action);
	else if (action?.kind === 'dismissal') {
		const { dismissAgain } = await import('./dismissals.js');
		await dismissAgain(action);
	}
	else if (action?.kind === 'follow') {
		const { redoFollow } = await import('./follow.js');
		await redoFollow(action);
	}
	else if (action?.kind === 'batch') {
		const { redoBatch } = await import('./queue_batches.js');
		await redoBatch(action);
	}
	else if (isAway.value) complain('Redo needs the server, which cannot be reached.');
	else if (action) await redoThere(action);
	else if (canRedoHere.value) submitTurn('redo');
	else explain('Nothing to redo.');
}

/** Return to a group and make its undone edit again. @param {EditDone} action */
async function redoThere(action) {
	if (onScreen.value !== action.group) navigate(reviewAddress(action.group));
	if (groupDocument.value?.id !== action.group) await open(action.group);
	if (groupDocument.value?.id !== action.group) return;
	didAgain(action);
	submitTurn('redo');
}

/** While the server is away only what it never saw can be taken back. @returns {boolean} whether something was */
function undoUnsent() {
	const own = outbox.value.filter(({ group, edit }) => group === groupDocument.value?.id && edit);
	const last = own.at(-1);
	if (!last) {
		complain('Undo needs the server, which cannot be reached.');
		return false;
	}
	// The first of all may have reached the server, only its answer did not reach us; one that is busy has said no.
	if (last === outbox.value[0] && !busyWith.value) {
		submitTurn('undo');
		return true;
	}
	discard(({ id }) => id === last.id);
	announce('Undone.');
	wake();
	return true;
}
