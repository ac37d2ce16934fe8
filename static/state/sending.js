// @ts-check
/** One write after the other to the server: each needs the state that the one before has made. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { getGroup, requestTagged } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { isTeam, me, mustLogIn } from './me.js';
import { adopt, claimTab, isKept, outbox, revise, unbar } from './outbox.js';

/** @import {GroupDocument} from '../api/types.js' */
/** @import {Item} from './outbox.js' */

/**
 * @typedef {object} Receiver who hears what became of a write
 * @property {(item: Item, answer: GroupDocument, first: any) => void} delivered   `first`: the answer to its first sending
 * @property {(item: Item, error: ApiError) => void} refused
 */

const FIRST_RETRY = 1500;
const LAST_RETRY = 30_000;

/** Whether the server could not be reached, or had no time, when it was last asked for a write. */
export const isAway = signal(false);
/** What the server that is away said itself, as that it is busy; empty: it was not reached. */
export const busyWith = signal('');
/** Whether a write is on its way now. */
export const isSending = signal(false);
/** When the last write was answered, ms. */
export const savedAt = signal(/** @type {number | null} */ (null));
/** Whether the last answer was a refusal. */
export const wasRefused = signal(false);

/** Writes that wait for the server, and not for the person. */
export const waiting = computed(() => outbox.value.filter(({ held, barred }) => !held && !barred));

/** @type {Receiver} */
let receiver = { delivered: () => {}, refused: () => {} };
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;
let pause = FIRST_RETRY;
let takenUp = Promise.resolve();

/** @param {Receiver} one */
export function hearFrom(one) {
	receiver = one;
}

/** Look after what waits, now and from now on; takes over what an earlier page has left. */
export function startSending() {
	claimTab();
	addEventListener('online', takeUp);
	// Whoever logs in again finds their writes sent.
	effect(() => { if (!mustLogIn.value) untracked(wake); });
	// Other rights: what they bar now is barred again.
	effect(() => { if (me.value) untracked(tryBarred); });
	takenUp = takeUp();
}

/** Until what an earlier page has left is this one's to send, or cannot be. @returns {Promise<void>} */
export function untilTakenUp() {
	return takenUp.catch(() => {});
}

async function takeUp() {
	// The page before this one may not be quite gone yet.
	await adopt(takeUp);
	pause = FIRST_RETRY;
	wake();
}

/** Send what waits, unless that is being done. */
export async function wake() {
	clearTimeout(timer);
	if (isSending.value || mustLogIn.value) return;
	isSending.value = true;
	try {
		for (let next = waiting.value[0]; next; next = waiting.value[0]) {
			await isKept(next);
			// Meanwhile it may have been taken back, or changed.
			if (waiting.value[0] === next && !(await send(next))) break;
		}
	} finally {
		isSending.value = false;
	}
}

/** @param {Item} item @returns {Promise<boolean>} false when the server is away */
async function send({ id, path, method, body, etag, ...rest }) {
	const item = { id, path, method, body, etag, ...rest };
	try {
		const { json, replayed } = await requestTagged(path, { method, body, etag, key: id });
		// What an earlier page was answered is old by now.
		const answer = replayed ? await getGroup(item.group) : json;
		isAway.value = false;
		wasRefused.value = false;
		savedAt.value = Date.now();
		pause = FIRST_RETRY;
		receiver.delivered(item, answer, json);
		return true;
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		// It waits for whoever logs in again; the page asks them to. Who has done so meanwhile is not asked once more.
		if (error.status === 401) {
			if (!mustLogIn.value) timer = setTimeout(wake, FIRST_RETRY);
			return false;
		}
		if (isTeam && (error.status === 403 || error.status === 404)) {
			bar(item, error);
			return true;
		}
		if (error.isPassing) {
			tryLater(error);
			return false;
		}
		isAway.value = false;
		wasRefused.value = true;
		receiver.refused(item, error);
		return true;
	}
}

/** Keep what somebody may not do, and what they said on top of it. @param {Item} item @param {ApiError} error */
function bar({ group }, error) {
	isAway.value = false;
	wasRefused.value = true;
	revise((other) => (other.group === group && !other.held ? { ...other, barred: error.message } : other));
}

/** Send what somebody was not allowed, for they may now. */
export function tryBarred() {
	unbar();
	wake();
}

/** @param {ApiError} error */
function tryLater({ status, message, retryAfter }) {
	isAway.value = true;
	busyWith.value = status === 503 || status === 507 ? message : '';
	// Where the browser knows that there is no network it will say when there is.
	if (navigator.onLine) timer = setTimeout(wake, Math.max(pause, 1000 * retryAfter));
	pause = Math.min(LAST_RETRY, 2 * pause);
}
