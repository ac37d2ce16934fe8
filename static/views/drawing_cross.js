// @ts-check
/** The cross that the arrow keys move, where Enter draws. */

import { html } from 'htm/preact';

import { toScreen } from '../geometry/viewport.js';
import { cross } from '../state/drawing_cross.js';
import { drawing } from '../state/workspace.js';

/** @import {Viewport} from '../geometry/viewport.js' */

/** @param {{view: string, viewport: Viewport}} props key of the panel's view, and how it is shown */
export function DrawingCross({ view, viewport }) {
	const present = cross.value;
	if (present?.view !== view || drawing.value?.view !== view) return null;
	const { x, y } = toScreen(viewport, present.at);
	return html`<span class="drawing-cross" data-moved=${present.moved} style=${{ left: `${x}px`, top: `${y}px` }} aria-hidden="true"></span>`;
}
