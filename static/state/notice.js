// @ts-check
/** What the page says to the person: one notice to read, one sentence for screen readers. */

import { signal } from '@preact/signals';

/** @typedef {{text: string, tone: 'bad' | 'info', action?: {label: string, run: () => void}}} Notice */

/** The bar below the header; null when there is nothing to say. */
export const notice = signal(/** @type {Notice | null} */ (null));

/** The last thing that happened, for `aria-live`. */
export const announced = signal('');

/** @param {string} text */
export function announce(text) {
	announced.value = text;
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
