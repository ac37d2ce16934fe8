// @ts-check
/** Undo and redo: through the server, so that they survive a reload. */

import { computed } from '@preact/signals';

import { document, lastStation, pending, submitTurn } from './group.js';
import { lastAction } from './last_action.js';
import { announce, complain } from './notice.js';
import { discard, outbox } from './outbox.js';
import { isAway, wake } from './sending.js';
import { takeVerdictBack } from './verdicts.js';

const ownStation = computed(() => (
	lastStation.value?.group === document.value?.id ? (lastStation.value?.station ?? null) : null
));
/** What undo would take back, in words; null when there is nothing. */
export const undoable = computed(() => {
	const last = lastAction.value;
	if (last?.kind === 'verdict') return `Take back the verdict on group ${last.number}`;
	const edited = document.value?.can_undo || ownStation.value !== null || pending.value.length > 0;
	return edited ? 'Undo the last edit of this group' : null;
});
export const canRedo = computed(() => Boolean(document.value?.can_redo) || ownStation.value !== null);

/** Take back the verdict just given, else the last edit of this group, whoever made it. */
export function undo() {
	if (lastAction.value?.kind === 'verdict') takeVerdictBack();
	else if (undoable.value === null) announce('Nothing to undo.');
	else if (isAway.value) undoUnsent();
	else submitTurn('undo');
}

/** Make the undone edit again. */
export function redo() {
	if (!canRedo.value) announce('Nothing to redo.');
	else if (isAway.value) complain('Redo needs the server, which cannot be reached.');
	else submitTurn('redo');
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
