// @ts-check
/**
 * The cross of somebody who draws by keyboard. It begins where the thing may be; nothing is drawn
 * there before a person has moved it (or pointed somewhere), so that nobody draws what they did not
 * look at.
 */

import { signal } from '@preact/signals';

import { pointerPlace } from './workspace.js';

/** @import {PointJson, ViewJson} from '../api/types.js' */

/** What one press of an arrow moves the cross by, CSS pixels. */
const STEPS = { plain: 8, Shift: 40, Alt: 1 };

/** Where it stands, image pixels; null while nothing is drawn. */
export const cross = signal(/** @type {{view: string, at: PointJson, moved: boolean} | null} */ (null));

/** Where the pointer lay when the cross was set: resting there says nothing. @type {typeof pointerPlace.value} */
let resting = null;

/** Set the cross where the next thing may be. @param {ViewJson} view @param {PointJson} at */
export function setCross(view, at) {
	cross.value = { view: view.key, at, moved: false };
	resting = pointerPlace.peek();
}

/** Nothing is drawn any more. */
export function dropCross() {
	cross.value = null;
}

/**
 * Move the cross.
 *
 * @param {ViewJson} view @param {number} scale CSS pixels per image pixel
 * @param {number} x -1, 0 or 1 @param {number} y
 * @param {{shiftKey: boolean, altKey: boolean}} event
 */
export function moveCross(view, scale, x, y, { shiftKey, altKey }) {
	const present = cross.value;
	if (present?.view !== view.key) return;
	const step = (altKey ? STEPS.Alt : shiftKey ? STEPS.Shift : STEPS.plain) / scale;
	const inside = (/** @type {number} */ value, /** @type {number} */ size) => Math.min(Math.max(value, 0), size - 1);
	const at = { x: inside(present.at.x + x * step, view.width), y: inside(present.at.y + y * step, view.height) };
	cross.value = { ...present, at, moved: true };
}

/** The place that a person has chosen: the pointer's, else the cross's; null while they have chosen none. @param {ViewJson} view @returns {PointJson | null} */
export function chosenPlace(view) {
	const over = pointerPlace.value;
	if (over && over.view === view.key && over !== resting) return over.at;
	const present = cross.value;
	return present?.view === view.key && present.moved ? present.at : null;
}
