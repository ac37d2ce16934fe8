// @ts-check
/** The timeline of a match that static cameras filmed: its groups in order, scrubbed and played. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { listenToGroups } from '../api/events.js';
import { ApiError } from '../api/problem.js';
import { getTimeline } from '../api/timeline.js';
import { latest } from '../lib/latest.js';
import { navigate } from '../lib/router.js';
import { stored } from '../lib/storage.js';
import { known, load } from './documents.js';
import { groupDocument, settle } from './group.js';
import { loadImage } from './images.js';
import { currentId, reviewAddress } from './navigation.js';
import { announce, dismiss, explain } from './notice.js';

/** @import {GroupDocument} from '../api/types.js' */
/** @import {TimelineJson} from '../api/timeline.js' */

/** @typedef {{dataset: number, match: string, columns: TimelineJson}} Loaded */

/** Milliseconds that a frame stays while playing. */
const FRAME = 120;
/** What somebody else changed is shown after this many milliseconds at the latest. */
const REFRESH = 3000;
const AHEAD = 3;

/** What the strip shows of a group of static cameras. */
export const stripTab = stored('strip-tab', /** @type {string} */ ('ball'));
export const playing = signal(false);
/** The stretch that is shown, as indices of groups; null: all. */
export const span = signal(/** @type {{from: number, to: number} | null} */ (null));
/** Why there is no timeline. */
export const trouble = signal('');

const loaded = signal(/** @type {Loaded | null} */ (null));

/** Whether the group on screen was filmed by cameras that do not move. */
export const isStatic = computed(() => Boolean(groupDocument.value?.views.some(({ station }) => station.shared)));

/** The columns of the match on screen, with what is known newer of the group on screen. */
export const columns = computed(() => {
	const [present, at] = [loaded.value, groupDocument.value];
	if (!present || !at || present.dataset !== at.dataset.id || present.match !== at.match) return null;
	return withGroup(present.columns, at);
});

/** Place of the group on screen; -1 when it is not there. */
export const position = computed(() => (columns.value && groupDocument.value ? columns.value.id.indexOf(groupDocument.value.id) : -1));

/** @param {TimelineJson} all @param {GroupDocument} group @returns {TimelineJson} */
function withGroup(all, group) {
	const at = all.id.indexOf(group.id);
	if (at < 0 || !group.solution) return all;
	const { passes, first_failing: failing } = group.solution;
	const { state, stale } = group.verdict;
	if (all.passes[at] === passes && all.status[at] === state && all.stale[at] === stale) return all;
	return {
		...all, passes: all.passes.with(at, passes), gate: all.gate.with(at, failing?.gate ?? null),
		status: all.status.with(at, state), stale: all.stale.with(at, stale),
	};
}

const fetching = latest(REFRESH, async (/** @type {{dataset: number, match: string}} */ wanted, abort) => {
	try {
		const found = await getTimeline(wanted.dataset, wanted.match, abort);
		loaded.value = { ...wanted, columns: found };
		trouble.value = '';
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		trouble.value = error.message;
	}
});

/** Keep the timeline of the match on screen in step. @returns {() => void} */
export function startTimeline() {
	const stop = effect(() => {
		const at = groupDocument.value;
		if (!at) return;
		const present = untracked(() => loaded.value);
		if (present?.dataset === at.dataset.id && present.match === at.match) return;
		span.value = null;
		fetching.cancel();
		fetching.run({ dataset: at.dataset.id, match: at.match });
	});
	/** @param {string | null} name of the dataset in which something changed; null: any */
	const again = (name) => {
		const at = groupDocument.value;
		if (at && (name === null || name === at.dataset.name)) fetching.run({ dataset: at.dataset.id, match: at.match });
	};
	const deaf = listenToGroups((/** @type {{dataset: string}} */ event) => again(event.dataset), again);
	return () => { stop(); deaf(); fetching.cancel(); playing.value = false; };
}

/** Show the group at a place. @param {number} index @returns {number | null} its id */
function show(index) {
	const id = columns.value?.id[index];
	if (id === undefined) return null;
	if (id !== currentId()) {
		settle();
		dismiss();
		// Scrubbing leaves no trail in the history.
		navigate(reviewAddress(id), { replace: true });
	}
	return id;
}

const scrubbing = latest(40, async (/** @type {number} */ index) => {
	const [id, from] = [columns.value?.id[index], currentId()];
	if (id === undefined) return;
	// Shown only once it is there: an empty screen in between would take the curve and the keyboard's focus with it.
	// Why a group cannot be loaded is said by whoever shows it.
	if (!known(id)) await load(id).catch(() => {});
	if (currentId() === from) show(index);
});

/** Go to the group at a place; what is asked for faster than it can be shown is left out. @param {number} index */
export function scrubTo(index) {
	const last = (columns.value?.id.length ?? 0) - 1;
	if (last >= 0) scrubbing.run(Math.min(last, Math.max(0, index)));
}

/** Places in the order of their errors, the worst first. */
const worstFirst = computed(() => {
	const errors = columns.value?.error_px ?? [];
	const measured = errors.flatMap((error, index) => (error === null ? [] : [{ error, index }]));
	return measured.sort((a, b) => b.error - a.error || a.index - b.index).map(({ index }) => index);
});

/** Go to the worst frame; from there to the next worst. */
export function goToWorst() {
	const order = worstFirst.value;
	if (order.length === 0) {
		explain('No frame has an error yet.');
		return;
	}
	const next = order[(order.indexOf(position.value) + 1) % order.length];
	// Whoever stands on any other frame begins with the worst.
	const target = jumped === position.value ? next : order[0];
	jumped = target;
	scrubTo(target);
	announce(`Frame ${columns.value?.frame[target] ?? target + 1}: number ${order.indexOf(target) + 1} by size of the error.`);
}

let jumped = -1;

/** Start or stop to play. */
export function togglePlaying() {
	playing.value = !playing.value;
	announce(playing.value ? 'Playing.' : 'Stopped.');
	if (playing.value) play();
}

async function play() {
	while (playing.value) {
		const began = performance.now();
		const next = position.value + 1;
		const ids = columns.value?.id ?? [];
		if (next >= ids.length) {
			playing.value = false;
			explain('That was the last frame.');
			return;
		}
		await ready(ids.slice(next, next + AHEAD));
		await new Promise((resolve) => setTimeout(resolve, Math.max(0, began + FRAME - performance.now())));
		if (playing.value) show(next);
		// The next step counts from what is on screen, so it waits until it is.
		await shown(ids[next]);
	}
}

/** Wait for the first of some groups, its frames included; load the others meanwhile. @param {number[]} ids */
async function ready(ids) {
	const [first] = ids.map(async (id) => {
		const group = known(id) ?? (await load(id));
		await Promise.allSettled(group.views.map(({ image }) => image && loadImage(image)));
	});
	await first?.catch(() => { playing.value = false; });
}

/** @param {number} id */
function shown(id) {
	return new Promise((resolve) => {
		const stop = effect(() => {
			if (groupDocument.value?.id !== id && playing.value) return;
			queueMicrotask(() => { stop(); resolve(null); });
		});
	});
}

/** Show a shorter or longer stretch around a place. @param {number} factor below 1 comes closer @param {number} [around] index */
export function zoomSpan(factor, around = position.value) {
	const count = columns.value?.id.length ?? 0;
	if (count < 2) return;
	const { from, to } = span.value ?? { from: 0, to: count - 1 };
	const length = Math.min(count - 1, Math.max(20, (to - from) * factor));
	if (length >= count - 1) {
		span.value = null;
		return;
	}
	const at = Math.min(count - 1, Math.max(0, around));
	const share = to > from ? Math.min(1, Math.max(0, (at - from) / (to - from))) : 0.5;
	const start = Math.min(count - 1 - length, Math.max(0, at - share * length));
	span.value = { from: start, to: start + length };
}

/** Keep a place in sight. @param {number} index */
export function keepInSight(index) {
	const present = span.value;
	const count = columns.value?.id.length ?? 0;
	if (!present || index < 0 || (index >= present.from && index <= present.to)) return;
	const length = present.to - present.from;
	const from = Math.min(count - 1 - length, Math.max(0, index - length / 2));
	span.value = { from, to: from + length };
}
