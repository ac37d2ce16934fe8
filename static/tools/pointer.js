// @ts-check
/** The pointer over a panel: takes hold of things, pans, zooms. */

import { toImage } from '../geometry/viewport.js';
import { dragOf } from './drags.js';
import { hitTest } from './hit.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {ImagePoint, ScreenPoint, Viewport} from '../geometry/viewport.js' */
/** @import {Selection} from '../state/workspace.js' */
/** @import {Drag} from './drags.js' */
/** @import {Hit, PredictionAt} from './hit.js' */

/**
 * @typedef {object} Panel what the pointer needs to know and to say
 * @property {() => ViewJson} view
 * @property {() => Viewport} viewport
 * @property {() => Selection | null} selected
 * @property {() => boolean} enabled whether things can be taken hold of
 * @property {() => 'ball' | 'line' | null} draws what a click draws
 * @property {() => PredictionAt | undefined} predictionAt
 * @property {(hit: Hit | null) => string} hint what is said of the thing under the pointer
 * @property {(at: ImagePoint) => void} draw
 * @property {(at: ScreenPoint) => void} insert put a point on the line there
 * @property {(at: ImagePoint | null) => void} over where the pointer is; null: elsewhere
 * @property {(hit: Hit | null) => void} select
 * @property {(dx: number, dy: number) => void} pan
 * @property {(at: ScreenPoint, factor: number) => void} zoom
 */

const CLICK = 3;

/**
 * Listen to an element until the returned function is called.
 *
 * @param {HTMLElement} element @param {Panel} panel
 * @returns {() => void}
 */
export function attachPointer(element, panel) {
	/** @type {{id: number, start: ScreenPoint, last: ScreenPoint, drag: Drag | null, moved: boolean, draws: boolean} | null} */
	let gesture = null;

	/** @param {MouseEvent} event @returns {ScreenPoint} */
	function at(event) {
		const { left, top } = element.getBoundingClientRect();
		return { x: event.clientX - left, y: event.clientY - top };
	}

	/** @param {ScreenPoint} place */
	function hitAt(place) {
		if (!panel.enabled()) return null;
		// Where clicks draw, what is predicted is drawn over.
		const predictionAt = panel.draws() ? undefined : panel.predictionAt();
		return hitTest(panel.view(), panel.viewport(), place, panel.selected(), predictionAt);
	}

	/** @param {PointerEvent} event */
	function down(event) {
		if (gesture || event.button > 1) return;
		const start = at(event);
		if (event.button === 0 && event.altKey && panel.enabled()) {
			panel.insert(start);
			return;
		}
		const drawn = event.button === 0 ? panel.draws() : null;
		// A ball may lie on a line's point; a point beside another one is rather moved than doubled.
		const hit = event.button === 0 && drawn !== 'ball' ? hitAt(start) : null;
		const draws = drawn !== null && !hit;
		if (!draws) panel.select(hit);
		const drag = hit && dragOf(panel.view(), hit, toImage(panel.viewport(), start));
		gesture = { id: event.pointerId, start, last: start, drag, moved: false, draws };
		element.setPointerCapture(event.pointerId);
		element.dataset.cursor = drag ? 'moving' : 'panning';
	}

	/** @param {PointerEvent} event */
	function move(event) {
		const place = at(event);
		panel.over(toImage(panel.viewport(), place));
		if (!gesture) {
			const over = hitAt(place);
			element.title = panel.hint(over);
			element.dataset.cursor = over?.kind === 'prediction' ? 'predicted' : over ? 'movable' : panel.draws() ? 'drawing' : 'idle';
			return;
		}
		if (event.pointerId !== gesture.id) return;
		gesture.moved ||= Math.hypot(place.x - gesture.start.x, place.y - gesture.start.y) >= CLICK;
		if (!gesture.moved) return;
		if (gesture.drag) gesture.drag.move(toImage(panel.viewport(), place));
		else panel.pan(place.x - gesture.last.x, place.y - gesture.last.y);
		gesture.last = place;
	}

	/** @param {PointerEvent} event */
	function up(event) {
		if (event.pointerId !== gesture?.id) return;
		const { drag, moved, draws } = gesture;
		gesture = null;
		element.dataset.cursor = 'idle';
		if (drag && moved) drag.end();
		if (draws && !moved) panel.draw(toImage(panel.viewport(), at(event)));
	}

	function left() {
		panel.over(null);
	}

	/** @param {PointerEvent} event */
	function lost(event) {
		if (event.pointerId !== gesture?.id) return;
		gesture.drag?.cancel();
		gesture = null;
		element.dataset.cursor = 'idle';
	}

	/** @param {WheelEvent} event */
	function wheel(event) {
		event.preventDefault();
		const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
		panel.zoom(at(event), Math.exp(-event.deltaY * lines * 0.0016));
	}

	/** Escape gives back what is held. @param {KeyboardEvent} event */
	function key(event) {
		if (event.key !== 'Escape' || !gesture?.drag) return;
		event.stopPropagation();
		gesture.drag.cancel();
		gesture = null;
	}

	const attached = new AbortController();
	const { signal } = attached;
	element.addEventListener('pointerdown', down, { signal });
	element.addEventListener('pointermove', move, { signal });
	element.addEventListener('pointerup', up, { signal });
	element.addEventListener('pointercancel', lost, { signal });
	element.addEventListener('pointerleave', left, { signal });
	element.addEventListener('wheel', wheel, { passive: false, signal });
	addEventListener('keydown', key, { capture: true, signal });
	return () => attached.abort();
}
