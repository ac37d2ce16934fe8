// @ts-check
/** One view of the group: its frame with everything drawn on it. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useMemo, useRef } from 'preact/hooks';

import { ballCenter, ballOf } from '../geometry/preview.js';
import { toScreen } from '../geometry/viewport.js';
import { useSize } from '../lib/hooks.js';
import { ImageStage } from '../overlays/stage.js';
import { filterOf } from '../state/adjustments.js';
import { conflict } from '../state/conflict.js';
import { drawAt, insertAt } from '../state/drawing.js';
import { draft } from '../state/group.js';
import { suggestion } from '../state/suggestions.js';
import { placeOf } from '../state/tab_order.js';
import { panPanel, viewportOf, zoomPanel } from '../state/viewports.js';
import {
	boxes, drawing, editing, focused, focusView, gain, isSmall, otherInstant, overlaysHidden, pointerPlace, projections,
	selected, toggleMaximised,
} from '../state/workspace.js';
import { attachPointer } from '../tools/pointer.js';
import { ClassChooser } from './class_chooser.js';
import { DrawingChip } from './drawing_chip.js';
import { DrawingCross } from './drawing_cross.js';
import { useFrame } from './frame.js';
import { InstantChip } from './instant_chip.js';
import { ObjectList } from './object_list.js';
import { PanelCaption } from './panel_caption.js';
import { PanelTools } from './panel_tools.js';
import { PredictionChip } from './prediction_parts.js';

/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */
/** @import {Hit} from '../tools/hit.js' */

/** @type {import('../state/conflict.js').Field[]} */
const NO_GHOSTS = [];

/** @type {Map<number, ImagePoint | null>} */
const middles = new Map();

/**
 * What a picture shows in its middle when it is cropped: the ball, else the markings. It stays
 * as it was when the view was first shown, or the picture would run away under a drag.
 *
 * @param {ViewPicture} picture @returns {ImagePoint | null}
 */
function middleOf({ view, ball: fit, markings }) {
	const known = middles.get(view.id);
	if (known !== undefined) return known;
	const ball = ballOf(view);
	const points = markings.flatMap((marking) => marking.points.map(({ point }) => point));
	const mean = points.length === 0 ? null : {
		x: points.reduce((sum, { x }) => sum + x, 0) / points.length,
		y: points.reduce((sum, { y }) => sum + y, 0) / points.length,
	};
	const seen = fit?.reprojected ? { x: fit.reprojected[0], y: fit.reprojected[1] } : null;
	const middle = (ball && ballCenter(ball)) ?? seen ?? mean;
	if (middles.size > 400) middles.clear();
	middles.set(view.id, middle);
	return middle;
}

/** @param {string} key @param {Hit | null} hit @returns {import('../state/workspace.js').Selection | null} */
function selectionOf(key, hit) {
	if (!hit) return null;
	if (hit.kind === 'point') return { kind: 'point', view: key, marking: hit.marking, index: hit.index };
	if (hit.kind === 'prediction') return { kind: 'prediction', view: key, prediction: hit.prediction };
	return { kind: 'ball', view: key };
}

/** What is said of a prediction that the pointer is over. @param {ViewPicture['predictions']} predictions @param {Hit | null} hit */
function hintOf(predictions, hit) {
	const mark = hit?.kind === 'prediction' ? predictions?.marks.find(({ id }) => id === hit.prediction) : undefined;
	return mark ? `${mark.name} predicts a ball here, score ${mark.score.toFixed(2)}. Click to select it, Y accepts it.` : '';
}

/**
 * @param {{picture: ViewPicture, area: string, sizes: boolean}} props area: its place in the grid;
 *   sizes: whether the views may have other sizes
 */
export function ImagePanel({ picture, area, sizes }) {
	const { view } = picture;
	const { letter } = view;
	const [ref, size] = useSize();
	const stage = useRef(/** @type {ImageStage | null} */ (null));
	const figure = useRef(/** @type {HTMLElement | null} */ (null));
	const instant = otherInstant.value?.view === view.id ? otherInstant.value : null;
	const frame = useFrame(instant ? instant.image : view.image);
	const center = middleOf(picture);
	const viewport = viewportOf(letter, view, size, center);
	const now = { view, size, viewport, center, predictions: picture.predictions, elsewhere: instant !== null };
	const latestProps = useRef(now);
	latestProps.current = now;

	useLayoutEffect(() => {
		const element = /** @type {HTMLDivElement} */ (ref.current);
		const made = new ImageStage(element);
		stage.current = made;
		const detach = attachPointer(element, {
			view: () => latestProps.current.view,
			viewport: () => latestProps.current.viewport,
			selected: () => selected.value,
			enabled: () => !overlaysHidden.value && !latestProps.current.elsewhere && !isSmall(),
			draws: () => {
				const present = drawing.value;
				return present?.view === latestProps.current.view.key && present.what !== 'ask' ? present : null;
			},
			predictionAt: () => (boxes.value ? latestProps.current.predictions?.at : undefined),
			hint: (hit) => hintOf(latestProps.current.predictions, hit),
			draw: (at) => drawAt(latestProps.current.view, at),
			insert: (at) => {
				if (!latestProps.current.elsewhere) insertAt(latestProps.current.view, latestProps.current.viewport, at);
			},
			over: (at) => {
				const { letter: name, key } = latestProps.current.view;
				if (at) pointerPlace.value = { letter: name, view: key, at };
				else if (pointerPlace.peek()?.letter === name) pointerPlace.value = null;
			},
			select: (hit) => {
				focusView(latestProps.current.view.letter);
				selected.value = selectionOf(latestProps.current.view.key, hit);
			},
			pan: (dx, dy) => {
				const { view: v, size: s, center: c } = latestProps.current;
				panPanel(v.letter, v, s, dx, dy, c);
			},
			zoom: (at, factor) => {
				const { view: v, size: s, center: c } = latestProps.current;
				zoomPanel(v.letter, v, s, at, factor, c);
			},
		});
		return () => { detach(); made.destroy(); };
	}, []);

	useLayoutEffect(() => stage.current?.show(frame.image), [frame.image]);
	// Where nobody has drawn the ball, the other views' rays say where to look.
	const rays = draft.value?.kind === 'ball' || selected.value?.kind === 'ball' || view.balls.length === 0;
	const meant = suggestion.value?.view === view.key && !draft.value ? suggestion.value : null;
	const draws = drawing.value?.view === view.key && drawing.value.what !== 'ask';
	const scene = useMemo(() => ({
		picture, viewport, rays, selected: selected.value, hidden: overlaysHidden.value || instant !== null,
		projections: projections.value, boxes: boxes.value, gain: gain.value,
		ghosts: conflict.value?.fields ?? NO_GHOSTS, meant, draws,
	}), [
		picture, viewport.scale, viewport.left, viewport.top, rays, selected.value,
		overlaysHidden.value, instant, projections.value, boxes.value, gain.value, conflict.value, meant, draws,
	]);
	const filter = filterOf(letter);
	useLayoutEffect(() => stage.current?.adjust(filter), [filter]);
	useLayoutEffect(() => {
		if (size.width === 0 || !stage.current) return;
		stage.current.resize(size.width, size.height);
		stage.current.draw(scene);
	}, [scene, size.width, size.height]);

	/** Twice on the picture, not on what stands on it, and not while clicks draw. @param {MouseEvent} event */
	function maximise({ target }) {
		if (drawing.value || !(target instanceof Element) || !target.closest('.image-panel__stage')) return;
		toggleMaximised(letter);
	}

	const isFocused = focused.value === letter;
	const place = selected.value?.view === view.key ? placeOf(selected.value, view, picture.predictions?.marks) : null;
	const listSide = place && toScreen(viewport, place).x > size.width / 2 ? 'left' : 'right';
	// Two frames on screen would leave it open which view the keys mean.
	useEffect(() => {
		const held = document.activeElement;
		if (isFocused && held?.matches('.image-panel') && held !== figure.current) figure.current?.focus({ preventScroll: true });
	}, [isFocused]);
	return html`
		<figure
			class="image-panel" ref=${figure}
			data-view=${letter}
			data-focused=${isFocused}
			data-included=${view.included}
			tabindex="0"
			style=${{ gridArea: area }}
			aria-label=${`View ${letter}, ${view.label}. Press I to step through its objects.`}
			onFocus=${() => focusView(letter)}
			onDblClick=${maximise}
		>
			<div class="image-panel__stage" data-ready=${Boolean(frame.image)} data-frame=${frame.image ? view.id : undefined} data-offset=${instant?.offset} ref=${ref}></div>
			${view.image ? null : html`<p class="image-panel__missing">No frame<span class="image-panel__rest"> · lines and ball can be edited</span></p>`}
			${frame.error ? html`<p class="image-panel__missing">The frame of this view cannot be read.</p>` : null}
			<${PanelCaption} picture=${picture} frame=${frame.image} />
			<${PanelTools} picture=${picture} sizes=${sizes} />
			<${DrawingCross} view=${view.key} viewport=${viewport} />
			<${DrawingChip} view=${view.key} />
			${instant ? html`<${InstantChip} label=${instant.label} />` : null}
			${picture.predictions && !drawing.value ? html`<${PredictionChip} picture=${picture} />` : null}
			${drawing.value?.view === view.key && drawing.value.what === 'ask' ? html`<${ClassChooser} picture=${picture} />` : null}
			${isFocused && editing.value && !conflict.value ? html`<${ObjectList} picture=${picture} side=${listSide} />` : html`
				<button
					class="image-panel__edit" type="button"
					onClick=${() => { focusView(letter); editing.value = true; }}
				>Objects of ${letter}</button>`}
		</figure>
	`;
}
