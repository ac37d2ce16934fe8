// @ts-check
/** Says that a panel shows another frame than its own, and leads back. */

import { html } from 'htm/preact';

import { backToInstant } from '../state/instants.js';

/** @param {{label: string}} props "1 frame later" */
export function InstantChip({ label }) {
	return html`
		<p class="drawing-chip instant-chip">
			<span><strong>${label}</strong>: view only</span>
			<button class="drawing-chip__end" type="button" onClick=${backToInstant}>Back <kbd>Esc</kbd></button>
		</p>
	`;
}
