// @ts-check
/** The badge of a view: its letter on its colour. */

import { html } from 'htm/preact';

/** @param {{letter: string}} props */
export function Letter({ letter }) {
	return html`<b class="letter" data-letter=${letter}>${letter}</b>`;
}
