// @ts-check
/** Verdicts: shown and left behind at once, put back when the server refuses. */

import { signal } from '@preact/signals';

import * as client from '../api/client.js';
import { navigate } from '../lib/router.js';
import { known, remember } from './documents.js';
import { document, queued, settle } from './group.js';
import { currentId, goNext, query, queueAddress, reviewAddress } from './navigation.js';
import { announce, inform } from './notice.js';
import { asking } from './workspace.js';

/** @import {GroupDocument, VerdictJson} from '../api/types.js' */

/** Reasons to reject, in the order of their digits. */
export const REASONS = [
	{ name: 'bad_field_lines', label: 'Bad field lines' },
	{ name: 'sides_confused', label: 'Sides confused' },
	{ name: 'not_same_instant', label: 'Not the same instant' },
	{ name: 'ball_not_visible', label: 'Ball not visible' },
	{ name: 'bad_calibration', label: 'Bad calibration' },
	{ name: 'duplicate_view', label: 'Duplicate view' },
	{ name: 'other', label: 'Other…' },
];

/** The reason last used, for `X X`. */
export const lastReason = signal(/** @type {string | null} */ (null));

/** Accept and go on; a group that fails a gate needs a note that says why. */
export function accept() {
	const group = document.value;
	if (!group) return;
	if (!group.solution) {
		announce('This group is not solved yet and cannot be accepted.');
		return;
	}
	if (!group.solution.passes) asking.value = 'override';
	else decide('accepted', null, null);
}

/** Ask for the reason to reject. */
export function askReason() {
	if (document.value) asking.value = 'reason';
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
	const group = document.value;
	if (!group) return;
	asking.value = null;
	if (reason) lastReason.value = reason;
	settle();
	const before = group.verdict;
	overlay(group, { ...before, state, reason, note, stale: false, at: new Date().toISOString() });
	announce(`Group ${group.number} ${state}.`);
	leave(group.dataset.name);
	queued(group.id, (present) => put(present, { state, reason, note }, before));
}

/** On to the next group, or back to the queue when that was the last one. @param {string} dataset */
async function leave(dataset) {
	if (await goNext()) return;
	inform('That was the last group of this queue.', {
		label: 'Back to the queue', run: () => navigate(queueAddress(dataset, query.value)),
	});
}

/**
 * @param {GroupDocument} present
 * @param {{state: string, reason: string | null, note: string | null}} verdict
 * @param {VerdictJson} before
 */
async function put(present, verdict, before) {
	try {
		return await client.putVerdict(present.id, verdict, present.etag);
	} catch (error) {
		// Bring the group back to the screen as it was; the caller says why.
		overlay(known(present.id) ?? present, before);
		if (currentId() !== present.id) navigate(reviewAddress(present.id));
		throw error;
	}
}

/** @param {GroupDocument} group @param {VerdictJson} verdict */
function overlay(group, verdict) {
	const next = { ...group, verdict };
	remember(next);
	if (document.value?.id === next.id) document.value = next;
}
