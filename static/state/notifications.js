// @ts-check
/** What somebody is told: mentions, replies, jobs that ended, work that is theirs. */

import { effect, signal, untracked } from '@preact/signals';

import { getNotifications, postNotificationsRead } from '../api/notifications.js';
import { listen } from '../api/events.js';
import { ApiError } from '../api/problem.js';
import { isTeam, mustLogIn, myName } from './me.js';

/** @import {NotificationsJson} from '../api/notifications.js' */

/** Jobs tell often how far they are; what is read waits so long for more, ms. */
const PAUSE = 250;
/** Jobs whose end somebody is told of. */
const ENDED = ['done', 'failed'];

/** Kinds of a group's changes of which somebody may be told. */
const TELLING = ['comment', 'take', 'work'];

/** What is told; null until it is known. */
export const bell = signal(/** @type {NotificationsJson | null} */ (null));

/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/** Read what there is to tell, soon. */
function readSoon() {
	clearTimeout(timer);
	timer = setTimeout(async () => {
		if (!mustLogIn.value) await take(getNotifications());
	}, PAUSE);
}

/** @param {Promise<NotificationsJson>} asked */
async function take(asked) {
	try {
		bell.value = await asked;
	} catch (error) {
		// What is told next reads it again.
		if (!(error instanceof ApiError)) throw error;
	}
}

/** It was seen. @param {number[] | null} ids null: all of it */
export function seen(ids) {
	return take(postNotificationsRead(ids));
}

/** Follow what is told to whoever is logged in. */
export function startNotifications() {
	if (!isTeam) return;
	effect(() => {
		if (!myName.value || mustLogIn.value) return undefined;
		return untracked(() => {
			readSoon();
			const deaf = [
				listen('group', ({ kind }) => { if (TELLING.includes(kind)) readSoon(); }, readSoon),
				listen('dataset', readSoon, readSoon),
				listen('job', ({ state }) => { if (ENDED.includes(state)) readSoon(); }, readSoon),
			];
			return () => { for (const stop of deaf) stop(); };
		});
	});
}
