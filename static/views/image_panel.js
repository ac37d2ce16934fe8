// @ts-check
/** One view of the group: its frame with everything drawn on it. */

import { html } from 'htm/preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';

import { useSize } from '../lib/hooks.js';
import { ImageStage } from '../overlays/stage.js';
import { draft } from '../state/group.js';
import { loadImage } from '../state/images.js';
import { panPanel, viewportOf, zoomPanel } from '../state/viewports.js';
import {
	boxes, editing, focused, focusView, gain, maximised, overlaysHidden, projections, selected,
	toggleMaximised,
} from '../state/workspace.js';
import { attachPointer } from '../tools/pointer.js';
import { ObjectList } from './object_list.js';
import { PanelCaption } from './panel_caption.js';

/** @import {ViewPicture} from '../overlays/scene.js' */
/** @import {Hit} from '../tools/hit.js' */

/** The frame of a view: undefined while it loads, null when there is none. @param {string | null} url */
function useFrame(url) {
	const [frame, setFrame] = useState(
		/** @type {{url: string | null, image: HTMLImageElement | null, error: boolean}} */
		({ url: null, image: null, error: false }),
	);
	useEffect(() => {
		let wanted = true;
		if (url) {
			loadImage(url).then(
				(image) => { if (wanted) setFrame({ url, image, error: false }); },
				() => { if (wanted) setFrame({ url, image: null, error: true }); },
			);
		}
		return () => { wanted = false; };
	}, [url]);
	return frame.url === url ? frame : { url, image: null, error: false };
}

/** @param {string} key @param {Hit | null} hit @returns {import('../state/workspace.js').Selection | null} */
function selectionOf(key, hit) {
	if (!hit) return null;
	if (hit.kind === 'point') return { kind: 'point', view: key, marking: hit.marking, index: hit.index };
	return { kind: 'ball', view: key };
}

/** @param {{picture: ViewPicture}} props */
export function ImagePanel({ picture }) {
	const { view } = picture;
	const { letter } = view;
	const [ref, size] = useSize();
	const stage = useRef(/** @type {ImageStage | null} */ (null));
	const frame = useFrame(view.image);
	const viewport = viewportOf(letter, view, size);
	const now = { view, size, viewport };
	const latestProps = useRef(now);
	latestProps.current = now;

	useEffect(() => {
		const element = /** @type {HTMLDivElement} */ (ref.current);
		const made = new ImageStage(element);
		stage.current = made;
		const detach = attachPointer(element, {
			view: () => latestProps.current.view,
			viewport: () => latestProps.current.viewport,
			selected: () => selected.value,
			enabled: () => !overlaysHidden.value,
			select: (hit) => {
				focusView(latestProps.current.view.letter);
				selected.value = selectionOf(latestProps.current.view.key, hit);
			},
			pan: (dx, dy) => panPanel(latestProps.current.view.letter, dx, dy),
			zoom: (at, factor) => {
				const { view: v, size: s } = latestProps.current;
				zoomPanel(v.letter, v, s, at, factor);
			},
		});
		return () => { detach(); made.destroy(); };
	}, []);

	useEffect(() => stage.current?.show(frame.image), [frame.image]);
	const rays = draft.value?.kind === 'ball' || selected.value?.kind === 'ball';
	const scene = useMemo(() => ({
		picture, viewport, rays, selected: selected.value, hidden: overlaysHidden.value,
		projections: projections.value, boxes: boxes.value, gain: gain.value,
	}), [
		picture, viewport.scale, viewport.left, viewport.top, rays, selected.value,
		overlaysHidden.value, projections.value, boxes.value, gain.value,
	]);
	useEffect(() => {
		if (size.width === 0 || !stage.current) return;
		stage.current.resize(size.width, size.height);
		stage.current.draw(scene);
	}, [scene, size.width, size.height]);

	const isFocused = focused.value === letter;
	return html`
		<figure
			class="image-panel"
			data-view=${letter}
			data-focused=${isFocused}
			data-included=${view.included}
			tabindex="0"
			aria-label=${`View ${letter}, ${view.label}. Enter to edit its objects.`}
			onFocus=${() => focusView(letter)}
			onDblClick=${() => toggleMaximised(letter)}
		>
			<div class="image-panel__stage" data-ready=${Boolean(frame.image)} ref=${ref}></div>
			${view.image ? null : html`<p class="image-panel__missing">No frame · lines and ball can be edited</p>`}
			${frame.error ? html`<p class="image-panel__missing">The frame of this view cannot be read.</p>` : null}
			<${PanelCaption} picture=${picture} />
			<button
				class="image-panel__maximise icon-button" type="button"
				aria-label=${maximised.value ? 'Show all views' : `Show only view ${letter}`}
				title=${maximised.value ? 'Show all views' : 'Show only this view'}
				onClick=${() => toggleMaximised(letter)}
			>
				<svg viewBox="0 0 16 16" aria-hidden="true"><path d=${maximised.value
					? 'M7 3v4H3M9 13V9h4' : 'M9 3h4v4M7 13H3V9'} /></svg>
			</button>
			${isFocused && editing.value ? html`<${ObjectList} picture=${picture} />` : html`
				<button
					class="image-panel__edit" type="button"
					onClick=${() => { focusView(letter); editing.value = true; }}
				>Objects of ${letter}</button>`}
		</figure>
	`;
}
