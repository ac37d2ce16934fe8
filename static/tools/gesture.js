// @ts-check
/** Gestures over a picture: what is pressed is dragged or clicked, else the picture is panned; the wheel zooms. */

import { toImage } from '../geometry/viewport.js';

/** @import {ImagePoint, ScreenPoint, Viewport} from '../geometry/viewport.js' */

/**
 * @typedef {object} Drag of what a press took hold of
 * @property {(to: ImagePoint, event: PointerEvent) => void} move
 * @property {(moved: boolean) => void} end
 * @property {() => void} cancel
 */
/** @typedef {{drag: Drag | null, click?: (at: ImagePoint) => void}} Press   click: where nothing is dragged and nothing was panned */
/**
 * @typedef {object} Picture what gestures ask and tell
 * @property {() => Viewport} viewport
 * @property {(at: ScreenPoint, event: PointerEvent) => Press | null} press null: no gesture begins
 * @property {(at: ScreenPoint) => string} hover the cursor over a place
 * @property {(at: ImagePoint | null) => void} over where the pointer is; null: elsewhere
 * @property {(at: ScreenPoint) => void} [twice] a double click
 * @property {(dx: number, dy: number) => void} pan
 * @property {(at: ScreenPoint, factor: number) => void} zoom
 */

const CLICK = 3;

/**
 * Listen to an element until the returned function is called.
 *
 * @param {HTMLElement} element @param {Picture} picture
 * @returns {() => void}
 */
export function attachGestures(element, picture) {
	/** @type {Press & {id: number, start: ScreenPoint, last: ScreenPoint, moved: boolean} | null} */
	let gesture = null;

	/** @param {MouseEvent} event @returns {ScreenPoint} */
	function at(event) {
		const { left, top } = element.getBoundingClientRect();
		return { x: event.clientX - left, y: event.clientY - top };
	}

	/** @param {PointerEvent} event */
	function down(event) {
		if (gesture || event.button > 1) return;
		const start = at(event);
		const press = picture.press(start, event);
		if (!press) return;
		gesture = { ...press, id: event.pointerId, start, last: start, moved: false };
		element.setPointerCapture(event.pointerId);
		element.dataset.cursor = press.drag ? 'moving' : 'panning';
	}

	/** @param {PointerEvent} event */
	function move(event) {
		const place = at(event);
		const to = toImage(picture.viewport(), place);
		picture.over(to);
		if (!gesture) {
			element.dataset.cursor = picture.hover(place);
			return;
		}
		if (event.pointerId !== gesture.id) return;
		gesture.moved ||= Math.hypot(place.x - gesture.start.x, place.y - gesture.start.y) >= CLICK;
		if (!gesture.moved) return;
		if (gesture.drag) gesture.drag.move(to, event);
		else picture.pan(place.x - gesture.last.x, place.y - gesture.last.y);
		gesture.last = place;
	}

	/** @param {PointerEvent} event */
	function up(event) {
		if (event.pointerId !== gesture?.id) return;
		const { drag, click, moved } = gesture;
		release();
		if (drag) drag.end(moved);
		else if (!moved) click?.(toImage(picture.viewport(), at(event)));
	}

	function release() {
		gesture = null;
		element.dataset.cursor = 'idle';
	}

	/** @param {PointerEvent} event */
	function lost(event) {
		if (event.pointerId !== gesture?.id) return;
		gesture.drag?.cancel();
		release();
	}

	/** @param {WheelEvent} event */
	function wheel(event) {
		event.preventDefault();
		const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
		picture.zoom(at(event), Math.exp(-event.deltaY * lines * 0.0016));
	}

	/** Escape gives back what is held. @param {KeyboardEvent} event */
	function key(event) {
		if (event.key !== 'Escape' || !gesture?.drag) return;
		event.stopPropagation();
		gesture.drag.cancel();
		release();
	}

	const attached = new AbortController();
	const { signal } = attached;
	element.addEventListener('pointerdown', down, { signal });
	element.addEventListener('pointermove', move, { signal });
	element.addEventListener('pointerup', up, { signal });
	element.addEventListener('pointercancel', lost, { signal });
	element.addEventListener('pointerleave', () => picture.over(null), { signal });
	element.addEventListener('dblclick', (event) => picture.twice?.(at(event)), { signal });
	element.addEventListener('wheel', wheel, { passive: false, signal });
	addEventListener('keydown', key, { capture: true, signal });
	return () => attached.abort();
}
