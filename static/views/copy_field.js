// @ts-check
/** A text that is shown once, to be copied. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

/** @param {{label: string, text: string, close: () => void}} props */
export function CopyField({ label, text, close }) {
	const [copied, setCopied] = useState(false);
	const copy = () => navigator.clipboard?.writeText(text).then(() => setCopied(true));
	return html`
		<p class="people__link">
			<input class="field" aria-label=${label} readonly value=${text} onFocus=${(/** @type {Event} */ event) => /** @type {HTMLInputElement} */ (event.currentTarget).select()} />
			<button class="button" type="button" onClick=${copy}>${copied ? 'Copied' : 'Copy'}</button>
			<button class="button" type="button" onClick=${close}>Done</button>
		</p>
	`;
}
