// @ts-check
/** How many threads are open, as a small sign. */

import { html } from 'htm/preact';

/** @param {{count: number}} props */
export function OpenComments({ count }) {
	if (!count) return null;
	const words = count === 1 ? 'open comment' : 'open comments';
	return html`<span class="open-comments" title=${`${count} ${words}`}><svg viewBox="0 0 16 16" aria-hidden="true"><path d="M2.5 3.5h11v7.5H8l-3 2.5V11H2.5z" /></svg>${count}<span class="hidden-text"> ${words}</span></span>`;
}
