// @ts-check
/** Undo and redo: through the server, so that they survive a reload. */

import { computed } from '@preact/signals';

import { navigate, page } from '../lib/router.js';
import { document, lastStation, open, pending, submitTurn } from './group.js';
import { actions, did, forget, forgetEdit, nextBack } from './last_action.js';
import { reviewAddress } from './navigation.js';
import { announce, complain } from './notice.js';
import { discard, outbox } from './outbox.js';
import { isAway, wake } from './sending.js';
import { takeVerdictBack } from './verdicts.js';

/** @import {EditDone} from './last_action.js' */

const ownStation = computed(() => (
	lastStation.value?.group === document.value?.id ? (lastStation.value?.station ?? null) : null
));
/** The group that the page is about, in the review as in the calibration editor. */
const onScreen = computed(() => ('group' in page.value ? page.value.group : null));
const next = computed(() => {
	const shown = onScreen.value === document.value?.id ? document.value : null;
	const edited = shown !== null && (shown.can_undo || ownStation.value !== null || pending.value.length > 0);
	return nextBack(actions.value, onScreen.value, edited);
});
/** What undo would take back, in words; null when there is nothing. */
export const undoable = computed(() => {
	const action = next.value;
	if (action === null) return null;
	if (action === 'here') return 'Undo the last edit of this group';
	if (action.kind === 'batch') return `Take back: ${action.text}`;
	if (action.kind === 'edit') return `Go back to group ${action.number} and undo its last edit`;
	return `Take back the verdict on group ${action.number}`;
});
export const canRedo = computed(() => Boolean(document.value?.can_redo) || ownStation.value !== null);

/** One after the other: the next one speaks about the group to which the last one led. */
let turn = Promise.resolve();

/** Take back what this window did last, wherever that was, else the last edit of this group, whoever made it. */
export function undo() {
	turn = turn.then(undoOne, undoOne);
}

async function undoOne() {
	const action = next.value;
	if (action === null) announce('Nothing to undo.');
	else if (action === 'here') undoHere();
	else if (action.kind === 'verdict') await takeVerdictBack(action);
	else if (action.kind === 'edit') await undoThere(action);
	else {
		// Bulk verdicts are the queue's: the review screen opens without them.
		const { takeBatchBack } = await import('./queue_batches.js');
		await takeBatchBack(action);
	}
}

function undoHere() {
	if (document.value) forgetEdit(document.value.id);
	if (isAway.value) undoUnsent();
	else submitTurn('undo');
}

/** Return to a group and undo its last edit. @param {EditDone} action */
async function undoThere(action) {
	navigate(reviewAddress(action.group));
	if (document.value?.id !== action.group) await open(action.group);
	if (document.value?.id !== action.group) return;
	if (document.value.can_undo) undoHere();
	else forget(action);
}

/** Make the undone edit again. */
export function redo() {
	if (!canRedo.value) announce('Nothing to redo.');
	else if (isAway.value) complain('Redo needs the server, which cannot be reached.');
	else {
		if (document.value) did({ kind: 'edit', group: document.value.id, number: document.value.number, times: 1 });
		submitTurn('redo');
	}
}

/** While the server is away only what it never saw can be taken back. */
function undoUnsent() {
	const own = outbox.value.filter(({ group, edit }) => group === document.value?.id && edit);
	const last = own.at(-1);
	if (!last) {
		complain('Undo needs the server, which cannot be reached.');
		return;
	}
	// The first of all may have reached the server, only its answer did not reach us.
	if (last === outbox.value[0]) {
		submitTurn('undo');
		return;
	}
	discard(({ id }) => id === last.id);
	announce('Undone.');
	wake();
}
