// @ts-check
/** The views of a group side by side: the main camera large, the others beside it. */

import { html } from 'htm/preact';

import { equalViews, maximised } from '../state/workspace.js';
import { ImagePanel } from './image_panel.js';

/** @import {ViewPicture} from '../overlays/scene.js' */

/** @param {{pictures: ViewPicture[]}} props */
export function ImageGrid({ pictures }) {
	const only = pictures.find(({ view }) => view.letter === maximised.value);
	const shown = only ? [only] : pictures;
	return html`
		<section class="image-grid" data-count=${Math.min(shown.length, 9)} data-equal=${equalViews.value} aria-label="Views">
			${shown.map((picture, i) => html`<${ImagePanel} key=${picture.view.letter} picture=${picture} first=${i === 0 && shown.length > 1} />`)}
		</section>
	`;
}
