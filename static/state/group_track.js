// @ts-check
/**
 * The track that the group on screen is in, and what an edit makes of it: the frames around it are tracked anew at once,
 * the whole when somebody asks for it. Asked for when a group has stood for a moment.
 */

import { computed, effect, signal, untracked } from '@preact/signals';

import { ApiError } from '../api/problem.js';
import { getTrackAround, getTracksOfGroup } from '../api/tracks.js';
import { groupDocument } from './group.js';

/** @import {TrackAround, TrackJson} from '../api/tracks.js' */

/** @typedef {{group: number, etag: string, track: TrackJson, frame: number}} Found */

/** How long a group stands before it is asked about, ms. */
const PAUSE = 150;
/** How long a match is taken to have no tracks, ms. */
const FRESH = 30_000;

const found = signal(/** @type {Found | null} */ (null));
const renewed = signal(/** @type {{group: number, etag: string, around: TrackAround} | null} */ (null));
/** Matches without tracks, and since when that is known. @type {Map<string, number>} */
const without = new Map();

/** The track of the group on screen; null where it is in none, or nobody knows yet. */
export const groupTrack = computed(() => (found.value?.group === groupDocument.value?.id ? found.value : null));
/** The frames around it as the group is now; null where the track is not stale. */
export const trackAround = computed(() => {
	const [at, now] = [groupDocument.value, renewed.value];
	return at && now?.group === at.id && now.etag === at.etag ? now.around : null;
});

/** @param {number} group @param {string} etag @param {string} match @param {AbortSignal} signal */
async function read(group, etag, match, signal) {
	const before = found.peek();
	const edited = before !== null && before.group === group && before.etag !== etag;
	// After an edit its track is known, and what comes of it is waited for: the server does nothing else meanwhile.
	if (edited) await around(before.track, before.frame, group, etag, signal);
	const { items } = await getTracksOfGroup(group, signal);
	const one = items.find(({ track }) => !track.summary.reason);
	if (!one) without.set(match, performance.now());
	found.value = one ? { group, etag, ...one } : null;
	if (one?.track.stale && !edited) await around(one.track, one.frame, group, etag, signal);
}

/** @param {TrackJson} track @param {number} frame @param {number} group @param {string} etag @param {AbortSignal} signal */
async function around({ id }, frame, group, etag, signal) {
	const answer = await getTrackAround(id, frame, signal);
	renewed.value = { group, etag, around: answer };
}

/** Follow the group on screen. @returns {() => void} ends it */
export function startGroupTrack() {
	return effect(() => {
		const at = groupDocument.value;
		if (!at) return undefined;
		const { id, etag, match } = at;
		return untracked(() => {
			const since = without.get(`${at.dataset.id} ${match}`);
			if (since !== undefined && performance.now() - since < FRESH) return undefined;
			const stop = new AbortController();
			const edited = found.peek()?.group === id;
			const ask = () => read(id, etag, `${at.dataset.id} ${match}`, stop.signal).catch((error) => {
				// It is asked about again with the next change.
				if (!stop.signal.aborted && !(error instanceof ApiError)) throw error;
			});
			// The page is drawn anew behind this: what was edited is asked about before that.
			const timer = edited ? void ask() : setTimeout(ask, PAUSE);
			return () => { clearTimeout(timer); stop.abort(); };
		});
	});
}
