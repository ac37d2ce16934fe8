// @ts-check
/** A button for what cannot be undone: it asks back, and forgets the question when one goes on. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

/**
 * @param {{label: string, question: string, what: string, small?: boolean, needs?: 'lead' | 'annotate', of?: string, run: () => void}} props
 *   what: for who hears the page; of: the dataset in which one needs the right
 */
export function ConfirmButton({ label, question, what, small = false, needs = 'lead', of, run }) {
	const [asked, setAsked] = useState(false);
	function press() {
		setAsked(!asked);
		if (asked) run();
	}
	return html`
		<button
			data-needs=${needs} data-of=${of} class=${`button ${small ? 'button--small ' : ''}${asked || !small ? 'button--danger' : ''}`} type="button" aria-live="polite"
			onClick=${press} onBlur=${() => setAsked(false)}
		>${asked ? question : label}<span class="hidden-text"> ${what}</span></button>
	`;
}
