// @ts-check
/**
 * The group of a batch that is on screen is this person's while it is there: nobody else is given it
 * by accident. A courtesy: what counts is decided by the state that each change names.
 */

import { computed, effect, signal, untracked } from '@preact/signals';

import { listen } from '../api/events.js';
import { ApiError } from '../api/problem.js';
import { deleteLease, postNext, putSubmission, putLease } from '../api/work.js';
import { navigate, page } from '../lib/router.js';
import { settle } from './group.js';
import { me, mustLogIn } from './me.js';
import { batchId, currentId, goNext, reviewAddress } from './navigation.js';
import { announce, complain, dismiss, explain, inform } from './notice.js';
import { outbox } from './outbox.js';
import { isAway } from './sending.js';

/** @import {ReturnedJson} from '../api/independent_annotations.js' */
/** @import {BatchJson, LeaseJson, Part, Presence} from '../api/work.js' */

/**
 * @typedef {object} Held
 * @property {number} batch @property {number} group
 * @property {'mine' | 'others' | 'lost' | 'none'} state `lost`: somebody has taken it over; `none`: it cannot be had
 * @property {Part | null} part
 * @property {Presence[]} here everybody who has it open
 * @property {string} sentence why it is not mine
 * @property {string | null} [submittedBy] who has handed it in
 * @property {ReturnedJson | null} [back] why its annotator has it back
 * @property {number | null} [place] of the groups that I annotate on my own, from 1
 * @property {number | null} [of] how many these are; null: nobody is told
 */

/** The group on screen as one of a batch; null: it is none, or nobody knows yet. */
export const lease = signal(/** @type {Held | null} */ (null));
/** The batch that is walked, as it was when it was asked for last. */
export const batch = signal(/** @type {BatchJson | null} */ (null));
/** Whether the next group is being asked for: a second key would speak about the group that is left. */
export const isMoving = signal(false);

/** Leases last three minutes. */
const AGAIN_MS = 60_000;

/** Who I am among those who are here. */
const myself = computed(() => me.value?.name ?? 'local');
/** Everybody else who has the group open. */
export const others = computed(() => (lease.value?.here ?? []).filter(({ person }) => person !== myself.value));

/** @param {LeaseJson} answer @param {number} id */
function got(answer, id) {
	batch.value = answer.batch;
	lease.value = { batch: answer.batch.id, group: id, state: 'mine', part: answer.part, here: answer.here, sentence: '', submittedBy: answer.submitted_by, back: answer.returned, place: answer.place, of: answer.of };
}

/** The group that is worked on, in the review as in the calibration editor; a number, so that another view of it is no news. */
const workedOn = computed(() => {
	const at = page.value;
	return at.page === 'review' || at.page === 'calibration' ? at.group : null;
});

/** @param {number} id @param {number} group */
const isHere = (id, group) => batchId.value === id && workedOn.value === group;

/** Take the group on screen, or let it stay mine. @param {number} id @param {number} group @param {boolean} [over] */
async function take(id, group, over = false) {
	try {
		const answer = await putLease(id, group, over);
		if (isHere(id, group)) got(answer, group);
		else if (workedOn.value !== group) giveBack(id, group);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		// While the server is away, or nobody is logged in, what one has stays one's own.
		if (!isHere(id, group) || error.isPassing || error.status === 401) return;
		const known = lease.value;
		const state = error.status !== 409 ? 'none' : known?.state === 'mine' || known?.state === 'lost' ? 'lost' : 'others';
		lease.value = { batch: id, group, state, part: known?.part ?? null, here: error.here ?? known?.here ?? [], sentence: error.message };
	}
}

/** Whether a verdict of mine on a group is still on its way. @param {number} group */
const waits = (group) => outbox.peek().some((item) => item.group === group && (item.verdict || item.edit) && !item.held);

/** @param {number} group */
const isJudged = (group) => outbox.peek().some((item) => item.group === group && item.verdict && !item.held);

/** @param {number} id @param {number} group */
function giveBack(id, group) {
	// Until what was said arrives nobody else shall begin with it; a verdict ends the lease.
	if (!waits(group)) deleteLease(id, group).catch(() => {});
}

/** Take the group that somebody else has open. */
export function takeOver() {
	const held = lease.value;
	if (held) take(held.batch, held.group, true);
}

/** @param {{batch: number, group: number, here: Presence[]}} told */
function heard({ group, here }) {
	const held = lease.value;
	if (!held || held.group !== group) return;
	const mine = here.some(({ person }) => person === myself.value);
	const [other] = here.filter(({ person }) => person !== myself.value);
	if (held.state === 'mine' && !mine && other) {
		lease.value = { ...held, here, state: 'lost', sentence: '' };
		announce(`${other.person} has taken this group over.`);
	} else {
		lease.value = { ...held, here };
		// Of two tabs of mine the one that closes ends the lease of both; a verdict or a submission ends it for good.
		const isOver = held.state === 'mine' && (isMoving.value || waits(group) || submitting.has(group));
		if (held.state !== 'none' && here.length === 0 && !isOver) take(held.batch, group);
	}
}

/**
 * The next group of a batch. A verdict of mine that is still on its way has not ended its lease: what it is about
 * comes back as mine when nothing else waits, and does not wait any more.
 *
 * @param {number} id @param {number} from @returns {Promise<LeaseJson>}
 */
async function nextThatWaits(id, from) {
	const judged = new Set([from]);
	let answer = await postNext(id, from);
	while (answer.group !== null && !judged.has(answer.group) && isJudged(answer.group)) {
		judged.add(answer.group);
		answer = await postNext(id, answer.group);
	}
	return answer.group !== null && judged.has(answer.group) ? { ...answer, group: null } : answer;
}

/**
 * On to the next group that waits for me; the one that I come from is not given again.
 *
 * @param {() => boolean} [stillWanted] asked once it is known which group that is
 */
export async function nextOfBatch(stillWanted = () => true) {
	const [id, from] = [batchId.value, currentId()];
	if (id === null || from === null || isMoving.value) return;
	isMoving.value = true;
	try {
		const answer = await nextThatWaits(id, from);
		batch.value = answer.batch;
		if (currentId() !== from || !stillWanted()) {
			if (answer.group !== null) giveBack(id, answer.group);
			return;
		}
		if (answer.group === null) sayDone(answer.batch);
		else goTo(answer, answer.group);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		// Without the server the batch is walked as it is known.
		if (error.status === 0) await goNext(stillWanted);
		else complain(`The next group is not available: ${error.message}`);
	} finally {
		isMoving.value = false;
	}
}

/** @param {LeaseJson} answer @param {number} group */
function goTo(answer, group) {
	settle();
	dismiss();
	got(answer, group);
	navigate(reviewAddress(group, `batch:${answer.batch.id}`));
}

/** @param {BatchJson} one */
function sayDone(one) {
	const left = one.groups - one.settled;
	const more = left > 0 ? ' Other people have the remaining groups open, or have to work on them first.' : '';
	inform(`No more groups for you in “${one.name}”.${more}`, { label: 'My work', run: () => navigate('/work') });
}

/** Begin or go on with a batch. @param {number} id @returns {Promise<boolean>} whether there is a group for me */
export async function goOn(id) {
	const answer = await postNext(id, null);
	batch.value = answer.batch;
	if (answer.group === null) return false;
	goTo(answer, answer.group);
	return true;
}

/** When everything that I said of a group has arrived. @param {number} group @returns {Promise<void>} */
function arrived(group) {
	return new Promise((resolve) => {
		const stop = effect(() => {
			if (outbox.value.some((item) => item.group === group && !item.held)) return;
			queueMicrotask(() => { stop(); resolve(); });
		});
	});
}

/** Whether the group on screen can be handed in here. */
export const canSubmit = computed(() => lease.value?.part === 'annotator' && lease.value.state === 'mine');

/** Groups that are being handed in: a second press says nothing new. @type {Set<number>} */
const submitting = new Set();

/** Done: hand the group in, and go on. */
export async function submitAndOpenNext() {
	const held = lease.value;
	if (!held || !canSubmit.value || isMoving.value || submitting.has(held.group)) return;
	submitting.add(held.group);
	try {
		// Who has gone elsewhere while it waited stays there.
		if (await handIn(held) && isHere(held.batch, held.group)) await nextOfBatch();
	} finally {
		submitting.delete(held.group);
	}
}

/** @param {Held} held @returns {Promise<boolean>} whether it was handed in */
async function handIn(held) {
	settle();
	if (isAway.value && waits(held.group)) inform('This group is submitted as soon as its changes are saved.');
	await arrived(held.group);
	if (outbox.value.some((item) => item.group === held.group)) {
		explain('First resolve the conflict: choose which version to keep.');
		return false;
	}
	try {
		await putSubmission(held.batch, held.group);
		announce('Submitted.');
		return true;
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`This group was not submitted: ${error.message}`);
		return false;
	}
}

/** Have the group on screen as long as it is there, wherever the address leads. */
export function startLeases() {
	effect(() => {
		const [id, group] = [batchId.value, workedOn.value];
		if (id === null || group === null || mustLogIn.value) {
			lease.value = null;
			return undefined;
		}
		return untracked(() => hold(id, group));
	});
}

/** @param {number} id @param {number} group @returns {() => void} ends it */
function hold(id, group) {
	if (lease.value?.group !== group || lease.value.batch !== id) lease.value = null;
	if (!lease.value) take(id, group);
	// What others have is mine as soon as they have left it, also where they could not say so.
	const again = () => { if (lease.value?.state !== 'none') take(id, group); };
	const timer = setInterval(again, AGAIN_MS);
	const leave = () => giveBack(id, group);
	const deaf = listen('work', heard, again);
	// It was handed back to me while I look at it.
	const deafToo = listen('group', (told) => { if (told.group === group && told.kind === 'work') again(); });
	addEventListener('pagehide', leave);
	return () => {
		clearInterval(timer);
		removeEventListener('pagehide', leave);
		deaf();
		deafToo();
		leave();
	};
}
