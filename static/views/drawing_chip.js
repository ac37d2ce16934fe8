// @ts-check
/** What a click draws now, and how to stop. */

import { html } from 'htm/preact';

import { plainMarking } from '../geometry/marking_words.js';
import { endDrawing } from '../state/drawing.js';
import { drawing } from '../state/workspace.js';

/** @param {{view: string}} props key of the panel's view */
export function DrawingChip({ view }) {
	const present = drawing.value;
	if (present?.view !== view || present.what === 'ask') return null;
	return html`
		<p class="drawing-chip">
			<span>${present.what === 'ball' ? 'Click where the ball is' : html`<strong>${present.marking}</strong> <span class="drawing-chip__keys">(${plainMarking(present.marking)})</span> · click adds a point`}<span class="drawing-chip__keys"> · or <kbd>← ↑ → ↓</kbd> <kbd>Enter</kbd></span></span>
			<button class="drawing-chip__end" type="button" onClick=${endDrawing}>Done <kbd>Esc</kbd></button>
		</p>
	`;
}
