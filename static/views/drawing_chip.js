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
			<span title=${present.what === 'ball' ? '' : plainMarking(present.marking)}>${present.what === 'ball' ? 'Click where the ball is' : html`Click adds a point to <strong>${present.marking}</strong>`}</span>
			<span class="drawing-chip__keys">or <kbd>← ↑ → ↓</kbd> <kbd>Enter</kbd></span>
			<button class="drawing-chip__end" type="button" onClick=${endDrawing}>Done <kbd>Esc</kbd></button>
		</p>
	`;
}
