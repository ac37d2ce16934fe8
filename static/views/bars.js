// @ts-check
/** Bars below the header: what went wrong. They block nothing. */

import { html } from 'htm/preact';

import { announced, dismiss, notice } from '../state/notice.js';

export function NoticeBar() {
	const present = notice.value;
	if (!present) return null;
	const { text, tone, action } = present;
	return html`
		<div class="bar" data-tone=${tone} role=${tone === 'bad' ? 'alert' : 'status'}>
			<p>${text}</p>
			${action ? html`<button class="button" type="button" onClick=${() => { dismiss(); action.run(); }}>${action.label}</button>` : null}
			<button class="button" type="button" onClick=${dismiss}>Dismiss <kbd>Esc</kbd></button>
		</div>
	`;
}

/** Says to screen readers what just happened. */
export function Announcer() {
	return html`<p class="hidden-text" role="status" aria-live="polite">${announced.value}</p>`;
}
