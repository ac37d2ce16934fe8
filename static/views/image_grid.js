// @ts-check
/** The views of a group, arranged so that most of them is seen, and where the strip stands. */

import { html } from 'htm/preact';

import { arrangeScreen, gridArea, gridTracks, panelGrid } from '../geometry/panel_grid.js';
import { useSize } from '../lib/hooks.js';
import { sceneShown } from '../state/scene3d.js';
import { isStatic } from '../state/timeline.js';
import { equalViews, isSmall, maximised, stripCollapsed } from '../state/workspace.js';
import { ImagePanel } from './image_panel.js';

/** @import {Screen} from '../geometry/panel_grid.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

/** What is shown: all views, or the one that is shown alone. @param {ViewPicture[]} pictures */
function shownOf(pictures) {
	const only = pictures.find(({ view }) => view.letter === maximised.value);
	return only ? [only] : pictures;
}

/** @type {Map<string, Screen>} */
const screens = new Map();

/** Groups of one kind share their screen: it is worked out once. @param {ViewPicture[]} pictures @param {{width: number, height: number}} room */
function screenOf(pictures, room) {
	const images = shownOf(pictures).map(({ view: { width, height } }) => ({ width, height }));
	// The timeline and the 3D view need the width.
	const beside = !isStatic.value && !sceneShown.value && maximised.value === null;
	const how = { equal: equalViews.value, beside, folded: stripCollapsed.value };
	const key = JSON.stringify([images, room, how]);
	const known = screens.get(key) ?? arrangeScreen(images, room, how);
	if (screens.size > 100) screens.clear();
	screens.set(key, known);
	return known;
}

/**
 * Views and strip.
 *
 * @param {{pictures: ViewPicture[], children: import('preact').ComponentChildren}} props
 */
export function ReviewMain({ pictures, children }) {
	const [ref, size] = useSize();
	const screen = size.width > 0 && pictures.length > 0 ? screenOf(pictures, size) : null;
	const side = screen?.side ?? 'below';
	const strip = { '--views': shownOf(pictures).length, ...(screen && { [side === 'below' ? '--strip-height' : '--strip-width']: `${screen.strip}px` }) };
	return html`
		<main ref=${ref} class="review__main" data-collapsed=${stripCollapsed.value} data-side=${side} style=${strip}>${children}</main>
	`;
}

/** @param {{pictures: ViewPicture[]}} props */
export function ImageGrid({ pictures }) {
	const [ref, size] = useSize();
	const shown = shownOf(pictures);
	const grid = panelGrid(shown.map(({ view }) => view), size.width > 0 ? size : { width: 16, height: 9 }, equalViews.value || isSmall());
	return html`
		<section
			ref=${ref} class="image-grid" aria-label="Views"
			style=${{ gridTemplateColumns: gridTracks(grid.columns), gridTemplateRows: gridTracks(grid.rows) }}
		>
			${shown.map((picture, i) => html`
				<${ImagePanel} key=${picture.view.letter} picture=${picture} area=${gridArea(grid, i)} sizes=${i === 0 && shown.length > 2} />`)}
		</section>
	`;
}
