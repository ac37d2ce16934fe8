// @ts-check
/** The pointer over the editor's image: moves points, sets new ones, pans, zooms. */

import { toImage } from '../../geometry/viewport.js';
import { choice, held, hovered, lines, mode, stageLines } from '../../state/calibration.js';
import { withAdded, withPoint } from '../../state/line_changes.js';
import { announce } from '../../state/notice.js';
import { drawnToPaint, fetchPaint } from '../../state/paint.js';
import { choiceAt } from './hit.js';

/** @import {LinesJson} from '../../api/types.js' */
/** @import {MarkingResiduals} from '../../geometry/residual.js' */
/** @import {ImagePoint, ScreenPoint, Viewport} from '../../geometry/viewport.js' */

/**
 * @typedef {object} Panel
 * @property {() => Viewport} viewport
 * @property {() => MarkingResiduals[]} fits
 * @property {() => {width: number, height: number}} size of the image
 * @property {(dx: number, dy: number) => void} pan
 * @property {(at: ScreenPoint, factor: number) => void} zoom
 */
/** @typedef {{marking: string, index: number, before: LinesJson, offset: ImagePoint, label: string}} Drag */

const CLICK = 3;

/** @param {HTMLElement} element @param {Panel} panel @returns {() => void} */
export function attachEditor(element, panel) {
	/** @type {{id: number, start: ScreenPoint, last: ScreenPoint, drag: Drag | null, moved: boolean} | null} */
	let gesture = null;

	/** @param {MouseEvent} event @returns {ScreenPoint} */
	function at(event) {
		const { left, top } = element.getBoundingClientRect();
		return { x: event.clientX - left, y: event.clientY - top };
	}

	/** @param {ScreenPoint} place */
	function find(place) {
		return choiceAt(lines.value, panel.fits(), panel.viewport(), place, choice.value?.marking ?? null, panel.size());
	}

	/** @param {PointerEvent} event */
	function down(event) {
		if (gesture || event.button > 1) return;
		const start = at(event);
		gesture = { id: event.pointerId, start, last: start, drag: event.button === 0 ? take(start) : null, moved: false };
		element.setPointerCapture(event.pointerId);
		element.dataset.cursor = gesture.drag ? 'moving' : 'panning';
	}

	/** What a press takes hold of. @param {ScreenPoint} start @returns {Drag | null} */
	function take(start) {
		const place = toImage(panel.viewport(), start);
		const found = find(start);
		const chosen = choice.value;
		const foreign = found?.marking !== chosen?.marking;
		if (mode.value === 'draw' && chosen && (found === null || found.index === null || foreign)) {
			return setPoint(lines.value, chosen.marking, place);
		}
		if (!found) return null;
		choice.value = found;
		if (found.index === null) return null;
		const point = lines.value[found.marking][found.index];
		return {
			marking: found.marking, index: found.index, before: lines.value, label: 'Point moved',
			offset: { x: point.x - place.x, y: point.y - place.y },
		};
	}

	/** @param {LinesJson} before @param {string} marking @param {ImagePoint} place @returns {Drag} */
	function setPoint(before, marking, place) {
		const added = withAdded(before, marking, place);
		held.value = added.lines;
		choice.value = { marking, index: added.index };
		return { marking, index: added.index, before: added.lines, offset: { x: 0, y: 0 }, label: `Point on ${marking}` };
	}

	/** @param {PointerEvent} event */
	function move(event) {
		const place = at(event);
		if (!gesture) {
			const found = find(place);
			hovered.value = found?.marking ?? null;
			element.dataset.cursor = mode.value === 'draw' ? 'drawing' : found ? 'movable' : 'idle';
			return;
		}
		if (event.pointerId !== gesture.id) return;
		gesture.moved ||= Math.hypot(place.x - gesture.start.x, place.y - gesture.start.y) >= CLICK;
		if (!gesture.moved) return;
		if (gesture.drag) drag(gesture.drag, place, event.shiftKey);
		else panel.pan(place.x - gesture.last.x, place.y - gesture.last.y);
		gesture.last = place;
	}

	/** @param {Drag} drag @param {ScreenPoint} place @param {boolean} magnet whether the paint draws the point */
	function drag({ marking, index, before, offset }, place, magnet) {
		const { x, y } = toImage(panel.viewport(), place);
		const free = { x: x + offset.x, y: y + offset.y };
		if (magnet) fetchPaint();
		held.value = withPoint(before, marking, index, magnet ? drawnToPaint(marking, free) : free);
	}

	/** @param {PointerEvent} event */
	function up(event) {
		if (event.pointerId !== gesture?.id) return;
		const { drag: taken, moved, start } = gesture;
		gesture = null;
		element.dataset.cursor = 'idle';
		if (held.value && taken) stageLines(held.value, taken.label);
		else if (!moved && !taken && !find(start)) choice.value = null;
	}

	/** A double click sets a point on the line under it. @param {MouseEvent} event */
	function twice(event) {
		const found = find(at(event));
		if (!found || found.index !== null) return;
		const added = withAdded(lines.value, found.marking, toImage(panel.viewport(), at(event)));
		choice.value = { marking: found.marking, index: added.index };
		stageLines(added.lines, `Point on ${found.marking}`);
	}

	function lost() {
		gesture = null;
		held.value = null;
	}

	function left() {
		hovered.value = null;
	}

	/** @param {WheelEvent} event */
	function wheel(event) {
		event.preventDefault();
		const step = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
		panel.zoom(at(event), Math.exp(-event.deltaY * step * 0.0016));
	}

	/** Escape gives back what is held. @param {KeyboardEvent} event */
	function key(event) {
		if (event.key !== 'Escape' || !gesture?.drag) return;
		event.stopPropagation();
		lost();
		announce('Given back.');
	}

	const listeners = /** @type {[string, (event: any) => void][]} */ ([
		['pointerdown', down], ['pointermove', move], ['pointerup', up], ['pointercancel', lost],
		['pointerleave', left], ['dblclick', twice],
	]);
	const attached = new AbortController();
	const { signal } = attached;
	for (const [name, heard] of listeners) element.addEventListener(name, heard, { signal });
	element.addEventListener('wheel', wheel, { passive: false, signal });
	addEventListener('keydown', key, { capture: true, signal });
	return () => attached.abort();
}
