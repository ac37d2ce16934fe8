// @ts-check
/**
 * What the server tells by itself, for the whole page: read while somebody listens and looks.
 */

import { signal } from '@preact/signals';
import { readStream } from './shared_stream.js';

/** @typedef {'group' | 'job' | 'dataset' | 'work' | 'maintenance'} EventKind */
/** @typedef {{heard: (data: any) => void, missed: () => void}} Listener */

const KINDS = /** @type {const} */ (['group', 'job', 'dataset', 'work', 'maintenance']);

/** Whether the server can tell; where it cannot, ask. Left as it is while nobody looks. */
export const connected = signal(false);

/** @type {Map<string, Set<Listener>>} */
const listeners = new Map(KINDS.map((kind) => [kind, new Set()]));
/** @type {(() => void) | null} */
let end = null;
/** Whether there was a stream before the next one: between the two something may have happened. */
let resumes = false;
/** How things stood when the page began to read, for its first stream; '' where nobody said. */
let moment = (typeof document !== 'undefined' && document.documentElement.dataset.moment) || '';
/** What the server tells while it happens and never again. */
const FLEETING = /** @type {const} */ (['job', 'work']);

/**
 * Say how things stood before the page read anything, where the page itself does not.
 *
 * @param {string | null | undefined} said
 */
export function beginsAt(said) {
	moment ||= said ?? '';
}

const isHeard = () => [...listeners.values()].some((set) => set.size > 0);

/** @param {string} kind @param {string} text */
function told(kind, text) {
	const data = JSON.parse(text);
	for (const { heard } of [...(listeners.get(kind) ?? [])]) heard(data);
}

/** @param {boolean} late */
function opened(late) {
	connected.value = true;
	const kinds = resumes || late ? KINDS : FLEETING;
	const behind = kinds.flatMap((kind) => [...(listeners.get(kind) ?? [])]);
	resumes = true;
	moment = '';
	for (const { missed } of behind) missed();
}

function lost() {
	connected.value = false;
}

function open() {
	if (end || document.hidden || !isHeard()) return;
	end = readStream(KINDS, { opened, lost, told }, resumes ? '' : moment);
}

function rest() {
	end?.();
	end = null;
}

function follow() {
	if (document.hidden) rest();
	else open();
}

function close() {
	rest();
	document.removeEventListener('visibilitychange', follow);
	resumes = false;
	connected.value = false;
}

/**
 * Hear of groups that change, and of a dataset as a whole: so many groups are told as one change of theirs.
 *
 * @param {(data: any) => void} heard of one group
 * @param {(dataset: string | null) => void} missed anything may have changed: in a dataset, by its name, or, where
 *   the stream is there again after a while without one, in any
 * @returns {() => void}
 */
export function listenToGroups(heard, missed) {
	const deaf = [
		listen('group', heard, () => missed(null)),
		listen('dataset', (/** @type {{dataset: string | null}} */ event) => missed(event.dataset)),
	];
	return () => { for (const stop of deaf) stop(); };
}

/**
 * Hear of what happens, wherever it was done, until the returned function is called.
 *
 * @param {EventKind} kind @param {(data: any) => void} heard
 * @param {() => void} [missed] the stream is there after a while without one, in which something may have happened
 *   that it does not tell: what was shown may be old
 * @returns {() => void}
 */
export function listen(kind, heard, missed = () => {}) {
	const listener = { heard, missed };
	listeners.get(kind)?.add(listener);
	document.addEventListener('visibilitychange', follow);
	resumes = resumes || document.hidden;
	open();
	return () => {
		listeners.get(kind)?.delete(listener);
		if (!isHeard()) close();
	};
}
