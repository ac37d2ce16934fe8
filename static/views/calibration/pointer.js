// @ts-check
/** The pointer over the editor's image: moves points, sets new ones, chooses markings. */

import { toImage } from '../../geometry/viewport.js';
import { choice, held, hovered, lines, mode, stageLines } from '../../state/calibration.js';
import { withAdded, withPoint } from '../../state/line_changes.js';
import { announce } from '../../state/notice.js';
import { drawnToPaint, fetchPaint } from '../../state/paint.js';
import { attachGestures } from '../../tools/gesture.js';
import { choiceAt } from './hit.js';

/** @import {LinesJson} from '../../api/types.js' */
/** @import {MarkingResiduals} from '../../geometry/residual.js' */
/** @import {ImagePoint, ScreenPoint, Viewport} from '../../geometry/viewport.js' */
/** @import {Drag} from '../../tools/gesture.js' */

/**
 * @typedef {object} Panel
 * @property {() => Viewport} viewport
 * @property {() => MarkingResiduals[]} fits
 * @property {() => {width: number, height: number}} size of the image
 * @property {(dx: number, dy: number) => void} pan
 * @property {(at: ScreenPoint, factor: number) => void} zoom
 */

/** @param {HTMLElement} element @param {Panel} panel @returns {() => void} */
export function attachEditor(element, panel) {
	/** @param {ScreenPoint} place */
	function find(place) {
		return choiceAt(lines.value, panel.fits(), panel.viewport(), place, choice.value?.marking ?? null, panel.size());
	}

	/** @param {ScreenPoint} start @param {PointerEvent} event */
	function press(start, { button }) {
		const drag = button === 0 ? take(start) : null;
		return { drag, click: () => { if (!find(start)) choice.value = null; } };
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
		return pointDrag(lines.value, found.marking, found.index, 'Point moved', { x: point.x - place.x, y: point.y - place.y });
	}

	/** A point of the marking in hand, where it is pressed. @param {LinesJson} before @param {string} marking @param {ImagePoint} place */
	function setPoint(before, marking, place) {
		const added = withAdded(before, marking, place);
		held.value = added.lines;
		choice.value = { marking, index: added.index };
		return pointDrag(added.lines, marking, added.index, `Point added to ${marking}`, { x: 0, y: 0 });
	}

	/** @param {ScreenPoint} place */
	function hover(place) {
		const found = find(place);
		hovered.value = found?.marking ?? null;
		if (mode.value === 'draw') return 'drawing';
		return found ? 'movable' : 'idle';
	}

	/** @param {ImagePoint | null} at */
	function over(at) {
		if (!at) hovered.value = null;
	}

	/** A double click sets a point on the line under it. @param {ScreenPoint} place */
	function twice(place) {
		const found = find(place);
		if (!found || found.index !== null) return;
		const added = withAdded(lines.value, found.marking, toImage(panel.viewport(), place));
		choice.value = { marking: found.marking, index: added.index };
		stageLines(added.lines, `Point added to ${found.marking}`);
	}

	return attachGestures(element, { ...panel, press, hover, over, twice });
}

/**
 * The drag of a point, which keeps its distance from the pointer; with Shift the paint draws it.
 *
 * @param {LinesJson} before @param {string} marking @param {number} index
 * @param {string} label of the change @param {ImagePoint} offset
 * @returns {Drag}
 */
function pointDrag(before, marking, index, label, offset) {
	return {
		move({ x, y }, { shiftKey: magnet }) {
			const free = { x: x + offset.x, y: y + offset.y };
			if (magnet) fetchPaint();
			held.value = withPoint(before, marking, index, magnet ? drawnToPaint(marking, free) : free);
		},
		end() {
			if (held.value) stageLines(held.value, label);
		},
		cancel() {
			held.value = null;
			announce('Drag cancelled.');
		},
	};
}
