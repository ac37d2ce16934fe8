// @ts-check
/**
 * What the server tells by itself: one stream for the whole page, open while somebody listens and
 * looks. A browser opens six connections to a server in all its windows together, so a window that
 * nobody sees gives its own back.
 */

import { signal } from '@preact/signals';

/** @typedef {'group' | 'job' | 'dataset'} EventKind */
/** @typedef {{heard: (data: any) => void, missed: () => void}} Listener */

const KINDS = /** @type {const} */ (['group', 'job', 'dataset']);
const AGAIN = 5000;

/** Whether the server can tell; where it cannot, ask. Left as it is while nobody looks. */
export const connected = signal(false);

/** @type {Map<EventKind, Set<Listener>>} */
const listeners = new Map(KINDS.map((kind) => [kind, new Set()]));
/** @type {EventSource | null} */
let source = null;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let retry;
/** Whether there was a stream before the next one: between the two something may have happened. */
let resumes = false;

const isHeard = () => [...listeners.values()].some((set) => set.size > 0);

/** @param {EventKind} kind @param {MessageEvent} event */
function tell(kind, event) {
	const data = JSON.parse(event.data);
	for (const { heard } of [...(listeners.get(kind) ?? [])]) heard(data);
}

function opened() {
	connected.value = true;
	const late = resumes ? [...listeners.values()].flatMap((set) => [...set]) : [];
	resumes = true;
	for (const { missed } of late) missed();
}

function open() {
	clearTimeout(retry);
	if (source || document.hidden || !isHeard()) return;
	const stream = new EventSource('/api/v1/events');
	source = stream;
	stream.onopen = opened;
	stream.onerror = () => {
		connected.value = false;
		// The browser tries again by itself, but not after an answer that is no stream.
		if (stream.readyState !== EventSource.CLOSED || source !== stream) return;
		source = null;
		retry = setTimeout(open, AGAIN);
	};
	for (const kind of KINDS) stream.addEventListener(kind, (event) => tell(kind, event));
}

function rest() {
	clearTimeout(retry);
	source?.close();
	source = null;
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
 * Hear of what happens, wherever it was done, until the returned function is called.
 *
 * @param {EventKind} kind @param {(data: any) => void} heard
 * @param {() => void} [missed] the stream is there again after a while without one: what was shown
 *   may be old
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
