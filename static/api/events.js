// @ts-check
/** What the server tells by itself: one stream for the whole page, open while somebody listens. */

import { signal } from '@preact/signals';

/** @typedef {'group' | 'job' | 'dataset'} EventKind */

const KINDS = /** @type {const} */ (['group', 'job', 'dataset']);
const AGAIN = 5000;

/** Whether the server can tell; where it cannot, ask. */
export const connected = signal(false);

/** @type {Map<EventKind, Set<(data: any) => void>>} */
const listeners = new Map(KINDS.map((kind) => [kind, new Set()]));
/** @type {EventSource | null} */
let source = null;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let retry;

/** @param {EventKind} kind @param {MessageEvent} event */
function tell(kind, event) {
	const data = JSON.parse(event.data);
	for (const heard of [...(listeners.get(kind) ?? [])]) heard(data);
}

function open() {
	retry = undefined;
	const opened = new EventSource('/api/v1/events');
	source = opened;
	opened.onopen = () => { connected.value = true; };
	opened.onerror = () => {
		connected.value = false;
		// The browser tries again by itself, but not after an answer that is no stream.
		if (opened.readyState === EventSource.CLOSED && source === opened) retry = setTimeout(open, AGAIN);
	};
	for (const kind of KINDS) opened.addEventListener(kind, (event) => tell(kind, event));
}

function close() {
	clearTimeout(retry);
	source?.close();
	source = null;
	connected.value = false;
}

/**
 * Hear of what happens, wherever it was done, until the returned function is called.
 *
 * @param {EventKind} kind @param {(data: any) => void} heard
 * @returns {() => void}
 */
export function listen(kind, heard) {
	listeners.get(kind)?.add(heard);
	if (!source) open();
	return () => {
		listeners.get(kind)?.delete(heard);
		if ([...listeners.values()].every((set) => set.size === 0)) close();
	};
}
