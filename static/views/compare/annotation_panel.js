// @ts-check
/** One person's annotation of a view, on its frame; its neighbours zoom and move with it. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';

import { useSize } from '../../lib/hooks.js';
import Konva from '../../lib/konva.js';
import { drawMarked, drawOther } from '../../overlays/other_annotation.js';
import { ImageStage } from '../../overlays/stage.js';
import { others, pointed, sharedKey } from '../../state/compare.js';
import { fitPanel, panPanel, viewportOf, zoomPanel } from '../../state/viewports.js';
import { boxes, gain, overlaysHidden, projections } from '../../state/workspace.js';
import { attachPointer } from '../../tools/pointer.js';
import { useFrame } from '../frame.js';
import { PanelCaption } from '../panel_caption.js';

/** @import {ViewJson} from '../../api/types.js' */
/** @import {ViewPicture} from '../../overlays/scene.js' */
/** @import {Viewport} from '../../geometry/viewport.js' */

/** The stage of the review screen with what the other one drew. */
class ComparedStage extends ImageStage {
	/** @param {HTMLDivElement} container */
	constructor(container) {
		super(container);
		/** @type {{own: ViewJson, other: ViewJson | null, viewport: Viewport, marked: string | null} | null} */
		this.compared = null;
		this.above.add(new Konva.Shape({
			listening: false,
			sceneFunc: ({ _context: context }) => {
				if (!this.compared || this.scene?.hidden) return;
				const { own, other, viewport, marked } = this.compared;
				drawMarked(context, { view: own, viewport, marked });
				if (other) drawOther(context, { view: other, viewport, marked });
			},
		}));
	}
}

/**
 * @param {{picture: ViewPicture, other: ViewJson | null, number: number, name: string, image: string | null, chosen: boolean, choose: (() => void) | null}} props
 *   other: what somebody else drew in the view; number: the key that takes it
 */
export function AnnotationPanel({ picture, other, number, name, image: url, chosen, choose }) {
	const { view } = picture;
	const [ref, size] = useSize();
	const stage = useRef(/** @type {ComparedStage | null} */ (null));
	const { image } = useFrame(url);
	const key = sharedKey(view);
	const viewport = viewportOf(key, view, size);
	const now = useRef({ view, size, viewport });
	now.current = { view, size, viewport };

	useLayoutEffect(() => {
		const element = /** @type {HTMLDivElement} */ (ref.current);
		const made = new ComparedStage(element);
		stage.current = made;
		const detach = attachPointer(element, {
			view: () => now.current.view,
			viewport: () => now.current.viewport,
			selected: () => null,
			enabled: () => false,
			draws: () => null,
			predictionAt: () => undefined,
			hint: () => '',
			draw: () => {},
			insert: () => {},
			over: () => {},
			select: () => {},
			pan: (dx, dy) => panPanel(sharedKey(now.current.view), now.current.view, now.current.size, dx, dy),
			zoom: (at, factor) => zoomPanel(sharedKey(now.current.view), now.current.view, now.current.size, at, factor),
		});
		return () => { detach(); made.destroy(); };
	}, []);
	useEffect(() => () => fitPanel(key), [key]);
	useLayoutEffect(() => stage.current?.show(image), [image]);
	const marked = pointed.value?.view === view.key ? pointed.value.marking : null;
	const drawnOther = others.value ? other : null;
	useLayoutEffect(() => {
		const drawn = stage.current;
		if (size.width === 0 || !drawn) return;
		drawn.resize(size.width, size.height);
		drawn.compared = { own: view, other: drawnOther, viewport, marked };
		drawn.draw({
			picture, viewport, rays: false, selected: null, hidden: overlaysHidden.value, projections: projections.value,
			boxes: boxes.value, gain: gain.value,
		});
	}, [
		picture, drawnOther, marked, viewport.scale, viewport.left, viewport.top, size.width, size.height,
		overlaysHidden.value, projections.value, boxes.value, gain.value,
	]);
	return html`
		<section class="compare__one" aria-label=${`Annotation ${number}, ${name}`} data-chosen=${chosen}>
			<header class="compare__who">
				<kbd>${number}</kbd><strong>${name}</strong>
				${choose ? html`<button class="button" type="button" aria-pressed=${chosen} onClick=${choose}>${chosen ? '✓ Chosen' : `Choose ${number}`}</button>` : null}
			</header>
			<figure class="image-panel compare__panel" data-view=${view.letter} tabindex="0" aria-label=${`View ${view.letter} as ${name} annotated it`}>
				<div class="image-panel__stage" data-ready=${Boolean(image)} ref=${ref}></div>
				${url ? null : html`<p class="image-panel__missing">No frame</p>`}
				<${PanelCaption} picture=${picture} />
			</figure>
		</section>
	`;
}
