// @ts-check
/** Undo and redo: through the server, so that they survive a reload. */

import { computed } from '@preact/signals';

import * as client from '../api/client.js';
import { document, lastStation, pending, queued } from './group.js';
import { announce } from './notice.js';

const ownStation = computed(() => (
	lastStation.value?.group === document.value?.id ? (lastStation.value?.station ?? null) : null
));
export const canUndo = computed(() => Boolean(document.value?.can_undo) || ownStation.value !== null);
export const canRedo = computed(() => Boolean(document.value?.can_redo) || ownStation.value !== null);

/** Take back the last edit of this group, whoever made it. */
export function undo() {
	if (canUndo.value || pending.value.length > 0) turnBack('undo', 'Undone.');
	else announce('Nothing to undo.');
}

/** Make the undone edit again. */
export function redo() {
	if (canRedo.value) turnBack('redo', 'Done again.');
	else announce('Nothing to redo.');
}

/** @param {'undo' | 'redo'} verb @param {string} said */
function turnBack(verb, said) {
	const at = document.value;
	if (!at) return;
	queued(at.id, async (present) => {
		const station = present.views.find((view) => view.station.id === ownStation.value)?.station;
		const answer = station
			? await client.turnBackStation(verb, station.id, present.id, station.etag ?? '')
			: await client.turnBack(verb, present.id, present.etag);
		announce(said);
		return answer;
	});
}
