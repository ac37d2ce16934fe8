// @ts-check
/** Who is logged in, on the server of a team; one that somebody runs alone asks nobody. */

import { computed, signal } from '@preact/signals';

import { loggedOut } from '../api/client.js';
import { deleteSession, getSession } from '../api/people.js';

/** @import {Action, SessionJson} from '../api/people.js' */

/** Whether people log in here. */
export const isTeam = typeof document !== 'undefined' && document.documentElement.hasAttribute('data-team');

/** Who is logged in, or was until their session ended; null: nobody yet. */
export const me = signal(/** @type {SessionJson | null} */ (null));

/** Whether somebody has to log in before anything is sent. */
export const mustLogIn = computed(() => isTeam && (loggedOut.value || me.value === null));

/** Whose a write is: their name, or null where nobody logs in. */
export const myName = computed(() => me.value?.name ?? null);

/** @param {Action} action */
export function may(action) {
	return !isTeam || Boolean(me.value?.may.includes(action));
}

/** Somebody has logged in; another person than before starts with a page of their own. @param {SessionJson} session */
export function welcome(session) {
	if (me.value?.name && me.value.name !== session.name) {
		location.reload();
		return;
	}
	me.value = session;
	loggedOut.value = false;
}

/** Ask the server who is there. */
export async function askWhoIsThere() {
	const session = await getSession().catch(() => null);
	if (session?.name) welcome(session);
}

/** Log out, and leave nothing of it in this window. */
export async function logOut() {
	await deleteSession();
	location.assign('/groups');
}
