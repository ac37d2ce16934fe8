// @ts-check
/** What the page says to the person: one notice to read, one sentence about the last key or click. */

import { signal } from '@preact/signals';

/** @typedef {{text: string, tone: 'bad' | 'info', action?: {label: string, run: () => void}}} Notice */

/** The bar below the header; null when there is nothing to say. */
export const notice = signal(/** @type {Notice | null} */ (null));

/** The last thing that happened, for `aria-live`; `shown`: also to read, for a moment. */
export const announced = signal({ text: '', shown: false });

/** Say what the page shows anyway. @param {string} text */
export function announce(text) {
	announced.value = { text, shown: false };
}

/** Say, and show, why a key or a button changes nothing. @param {string} text */
export function explain(text) {
	announced.value = { text, shown: true };
}

/** @param {string} text @param {Notice['action']} [action] */
export function complain(text, action) {
	notice.value = { text, tone: 'bad', action };
}

/** @param {string} text @param {Notice['action']} [action] */
export function inform(text, action) {
	notice.value = { text, tone: 'info', action };
}

/** Take the notice away. */
export function dismiss() {
	notice.value = null;
}
