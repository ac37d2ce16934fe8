// @ts-check
/** Who is logged in, on the server of a team; one that somebody runs alone asks nobody. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { cameIn, forbidden, loggedOut } from '../api/client.js';
import { connected } from '../api/events.js';
import { deleteSession, getSession } from '../api/people.js';
import { publishBanner } from './maintenance.js';
import { inform } from './notice.js';

/** @import {Action, SessionJson, WaysIn} from '../api/people.js' */

/** Ids of datasets of copies lie above it (app/features/people/visibility_queries.py). */
export const COPIES = 1e9;

/** Whether people log in here. */
export const isTeam = typeof document !== 'undefined' && document.documentElement.hasAttribute('data-team');

/** Who is logged in, or was until their session ended; null: nobody yet. */
export const me = signal(/** @type {SessionJson | null} */ (null));

/** How people log in here. */
export const ways = signal(/** @type {WaysIn} */ ({ password: true, sign_on: null }));

/** Whether somebody has to log in before anything is sent. */
export const mustLogIn = computed(() => isTeam && (loggedOut.value || me.value === null || me.value.enrol));

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
	cameIn();
	const before = me.value;
	if (JSON.stringify(before) === JSON.stringify(session)) return;
	me.value = session;
	if (before?.name && rightsOf(before) !== rightsOf(session)) inform(`Your role was changed: ${rightsOf(session)}. Unsent changes stay in this browser.`);
}

/** @param {SessionJson} session */
function rightsOf({ role, datasets: every }) {
	// Copies of groups that somebody annotates on their own come and go; rights in them are those in what they are of.
	const datasets = every.filter(({ id }) => id <= COPIES);
	return [...datasets.map((one) => `${one.role} in ${one.dataset}`), `${role} in ${datasets.length ? 'the other' : 'all'} datasets`].join(', ');
}

/** Hear of other rights: when something was refused, when the stream begins anew, when somebody comes back to the window. */
export function startRights() {
	if (!isTeam) return;
	effect(() => { if (connected.value || forbidden.value) untracked(loadSession); });
	addEventListener('focus', () => { if (!mustLogIn.value) loadSession(); });
}

/** Ask the server who is there. @returns {Promise<SessionJson | null>} null: it did not say */
export async function loadSession() {
	const session = await getSession().catch(() => null);
	if (session?.ways) ways.value = session.ways;
	publishBanner(session?.maintenance);
	if (session?.name) welcome({ ...session, ways: null, moment: null, maintenance: null });
	return session;
}

/** Log out, and leave nothing of it in this window. */
export async function logOut() {
	await deleteSession();
	location.assign('/groups');
}
