// @ts-check
/** The notice of maintenance: what the server says, whether its time has come, and whether it was put away here. */

import { computed, effect, signal } from '@preact/signals';

import { listen } from '../api/events.js';
import { getSession } from '../api/people.js';

/** @import {BannerJson} from '../api/maintenance.js' */

const PUT_AWAY = 'touchline-banner';
/** Longest pause of a timer, ms. */
const LONGEST = 2 ** 31 - 1;

/** What an admin has set; null: nothing. */
export const banner = signal(/** @type {BannerJson | null} */ (null));
const now = signal(Date.now());
const putAway = signal(sessionText());

/** What is shown in this window now. */
export const shownBanner = computed(() => {
	const one = banner.value;
	return one && isTime(one, now.value) && JSON.stringify(one) !== putAway.value ? one : null;
});

/** Whether a notice is shown at a time. @param {BannerJson} one @param {number} at ms */
export function isTime({ starts, until }, at) {
	return (starts === null || Date.parse(starts) <= at) && (until === null || at < Date.parse(until));
}

/** When it next begins or ends after a time, ms; null: never. @param {BannerJson} one @param {number} at ms */
export function nextChange({ starts, until }, at) {
	const later = [starts, until].map((time) => (time === null ? NaN : Date.parse(time))).filter((time) => time > at);
	return later.length ? Math.min(...later) : null;
}

function sessionText() {
	try {
		return sessionStorage.getItem(PUT_AWAY);
	} catch {
		return null;
	}
}

/** Do not show it in this window again until it changes. */
export function hideBanner() {
	putAway.value = JSON.stringify(banner.value);
	try {
		sessionStorage.setItem(PUT_AWAY, putAway.value);
	} catch {
		// It comes back when the page is loaded anew.
	}
}

/** What the server says. @param {BannerJson | null | undefined} said */
export function publishBanner(said) {
	if (said !== undefined && JSON.stringify(said) !== JSON.stringify(banner.value)) banner.value = said;
}

/** Follow the notice, and the time. */
export function startMaintenance() {
	const said = document.documentElement.dataset.banner;
	if (said) publishBanner(JSON.parse(said));
	listen('maintenance', (/** @type {{banner: BannerJson | null}} */ event) => publishBanner(event.banner), () => {
		// On the server of a team the window asks who is there then, and is told.
		if (document.documentElement.hasAttribute('data-team')) return;
		getSession().then((session) => publishBanner(session.maintenance), () => {
			// The next event, or the next page, says it.
		});
	});
}

effect(() => {
	const one = banner.value;
	const next = one && nextChange(one, now.value);
	if (!next) return undefined;
	const timer = setTimeout(() => { now.value = Date.now(); }, Math.min(next - Date.now() + 50, LONGEST));
	return () => clearTimeout(timer);
});
effect(() => { if (banner.value) now.value = Date.now(); });
