// @ts-check
/** What changes elsewhere appears here: in another window, by another person, from a script. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { listenToGroups } from '../api/events.js';
import { ApiError } from '../api/problem.js';
import { page } from '../lib/router.js';
import { retry } from './arrival.js';
import { held, overlapsStaged, staging } from './calibration.js';
import { forget, forgetOthers, known, load, outdate } from './documents.js';
import { draft, groupDocument, renew } from './group.js';
import { announce } from './notice.js';
import { outbox } from './outbox.js';

/** @typedef {{group: number, etag: string | null, actor: string | null, waits?: boolean}} Told   waits: it was read, and changes a staged line */

/** The last change of the group on screen that was made elsewhere. */
export const changedElsewhere = signal(/** @type {{group: number, actor: string | null, at: number} | null} */ (null));

/** What was told of the group on screen and is not shown yet. @type {Told | null} */
let open = null;

/** @param {Told} told */
function heard(told) {
	outdate(told.group);
	const present = known(told.group);
	if (!present || present.etag === told.etag) return;
	if (told.group !== groupDocument.value?.id) {
		forget(told.group);
		return;
	}
	open = told;
	catchUp();
}

/** Whether the person has something in hand, or something of the group is on its way. @param {number} id */
function isBusy(id) {
	return draft.value !== null || held.value !== null || outbox.value.some((item) => item.group === id && !item.held);
}

/** Show what was told, once the person has nothing in hand and nothing on its way. */
async function catchUp() {
	const told = open;
	const at = groupDocument.value;
	if (!told || !at || isBusy(at.id)) return;
	open = null;
	if (told.group !== at.id || told.etag === at.etag) return;
	try {
		const newer = (told.waits && known(told.group)) || await load(told.group);
		// Whoever has gone on meanwhile is not told of what they left.
		if (newer.etag === at.etag || groupDocument.value?.id !== at.id) return;
		// The page keeps the state that the staged lines were drawn on: saving them then asks which version counts.
		if (page.value.page === 'calibration' && overlapsStaged(newer)) {
			open ??= { ...told, waits: true };
			if (!told.waits) announce('Another person or window changed a line that you have staged. Saving asks which version to keep.');
			return;
		}
		renew(newer);
		changedElsewhere.value = { group: at.id, actor: told.actor, at: Date.now() };
		announce('Another person or window changed this group; the page shows the new state.');
	} catch (error) {
		// The next visit reads it again.
		if (!(error instanceof ApiError)) throw error;
	}
}

/**
 * Nobody was told for a while, or of no group by itself: what lies ready may be old, and so may the group on screen.
 *
 * @param {string | null} dataset in which something changed; null: in any
 */
function missed(dataset) {
	retry();
	const at = groupDocument.value;
	forgetOthers(at?.id ?? null, dataset);
	if (at && (dataset === null || dataset === at.dataset.name)) heard({ group: at.id, etag: null, actor: null });
}

/** Listen while a group is on screen. */
export function startLive() {
	const listens = computed(() => page.value.page === 'review' || page.value.page === 'calibration');
	effect(() => (listens.value ? untracked(() => listenToGroups(heard, missed)) : undefined));
	effect(() => {
		if (draft.value === null && held.value === null && staging.value && outbox.value && groupDocument.value) untracked(catchUp);
	});
}
