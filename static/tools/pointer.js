// @ts-check
/** The pointer over a panel: takes hold of things, draws, selects. */

import { toImage } from '../geometry/viewport.js';
import { dragOf } from './drags.js';
import { attachGestures } from './gesture.js';
import { hitTest } from './hit.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {ImagePoint, ScreenPoint, Viewport} from '../geometry/viewport.js' */
/** @import {Selection} from '../state/workspace.js' */
/** @import {Press} from './gesture.js' */
/** @import {Hit, PredictionAt} from './hit.js' */

/**
 * @typedef {object} Panel what the pointer needs to know and to say
 * @property {() => ViewJson} view
 * @property {() => Viewport} viewport
 * @property {() => Selection | null} selected
 * @property {() => boolean} enabled whether things can be taken hold of
 * @property {() => {marking: string} | null} draws what a click draws; a ball has no marking
 * @property {() => PredictionAt | undefined} predictionAt
 * @property {(hit: Hit | null) => string} hint what is said of the thing under the pointer
 * @property {(at: ImagePoint) => void} draw
 * @property {(at: ScreenPoint) => void} insert put a point on the line there
 * @property {(at: ImagePoint | null) => void} over where the pointer is; null: elsewhere
 * @property {(hit: Hit | null) => void} select
 * @property {(dx: number, dy: number) => void} pan
 * @property {(at: ScreenPoint, factor: number) => void} zoom
 */

/**
 * Listen to an element until the returned function is called.
 *
 * @param {HTMLElement} element @param {Panel} panel
 * @returns {() => void}
 */
export function attachPointer(element, panel) {
	/** @param {ScreenPoint} place */
	function hitAt(place) {
		if (!panel.enabled()) return null;
		const [view, drawn] = [panel.view(), panel.draws()];
		if (!drawn) return hitTest(view, panel.viewport(), place, panel.selected(), panel.predictionAt());
		// Markings meet, a ball may lie on one, and what is predicted is drawn over: only the marking's own points are moved.
		const { [drawn.marking]: points = [] } = view.lines;
		return hitTest({ ...view, balls: [], lines: { [drawn.marking]: points } }, panel.viewport(), place, null);
	}

	/** @param {ScreenPoint} start @param {PointerEvent} event @returns {Press | null} */
	function press(start, { button, altKey }) {
		if (button !== 0) {
			panel.select(null);
			return { drag: null };
		}
		if (altKey && panel.enabled()) {
			panel.insert(start);
			return null;
		}
		const drawn = panel.draws();
		const hit = hitAt(start);
		if (drawn && !hit) return { drag: null, click: panel.draw };
		panel.select(hit);
		return { drag: hit && dragOf(panel.view(), hit, toImage(panel.viewport(), start)) };
	}

	/** @param {ScreenPoint} place */
	function hover(place) {
		const over = hitAt(place);
		element.title = panel.hint(over);
		if (over) return over.kind === 'prediction' ? 'predicted' : 'movable';
		return panel.draws() ? 'drawing' : 'idle';
	}

	return attachGestures(element, { ...panel, press, hover });
}
