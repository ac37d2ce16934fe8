// @ts-check
/** A button for what cannot be undone: it asks back, and forgets the question when one goes on. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

/**
 * @param {{label: string, question: string, what: string, small?: boolean, link?: boolean, needs?: 'lead' | 'annotate' | null, of?: string, run: () => void}} props
 *   what: for who hears the page; link: it looks like a link; of: the dataset in which one needs the right; needs null: everybody may
 */
export function ConfirmButton({ label, question, what, small = false, link = false, needs = 'lead', of, run }) {
	const [asked, setAsked] = useState(false);
	/** @param {MouseEvent} event */
	function press(event) {
		// The second click of a double click is no answer.
		if (event.detail > 1) return;
		setAsked(!asked);
		if (asked) run();
	}
	return html`
		<button
			data-needs=${needs} data-of=${of} type="button" aria-live="polite"
			class=${link ? 'link-button' : `button ${small ? 'button--small ' : ''}${asked || !small ? 'button--danger' : ''}`}
			onClick=${press} onBlur=${() => setAsked(false)}
		>${asked ? question : label}<span class="hidden-text"> ${what}</span></button>
	`;
}
