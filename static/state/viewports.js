// @ts-check
/** Zoom and place of each panel, by letter; they stay from group to group. */

import { signal } from '@preact/signals';

import { centeredOn, fit, pan, zoomAbout } from '../geometry/viewport.js';

/** @import {ImagePoint, ScreenPoint, Size, Viewport} from '../geometry/viewport.js' */

/** A panel without an entry shows its whole image. */
const viewports = signal(/** @type {Record<string, Viewport>} */ ({}));

/** @param {string} letter @param {Size} image @param {Size} panel @returns {Viewport} */
export function viewportOf(letter, image, panel) {
	return viewports.value[letter] ?? fit(image, panel);
}

/** @param {string} letter @param {Viewport} viewport */
function put(letter, viewport) {
	viewports.value = { ...viewports.value, [letter]: viewport };
}

/** Whether a panel shows less than its whole image. @param {string} letter */
export function isZoomed(letter) {
	return letter in viewports.value;
}

/** @param {string} letter */
export function fitPanel(letter) {
	const { [letter]: _, ...rest } = viewports.value;
	viewports.value = rest;
}

/** Show every image whole. */
export function fitAll() {
	viewports.value = {};
}

/**
 * @param {string} letter @param {Size} image @param {Size} panel @param {ScreenPoint} at
 * @param {number} factor
 */
export function zoomPanel(letter, image, panel, at, factor) {
	const whole = fit(image, panel).scale;
	const next = zoomAbout(viewportOf(letter, image, panel), at, factor, whole);
	if (next.scale <= whole * 1.001) fitPanel(letter);
	else put(letter, next);
}

/** @param {string} letter @param {number} dx @param {number} dy */
export function panPanel(letter, dx, dy) {
	const present = viewports.value[letter];
	// A whole image has nowhere to go.
	if (present) put(letter, pan(present, dx, dy));
}

/** @param {string} letter @param {Size} panel @param {ImagePoint} point @param {number} scale */
export function zoomTo(letter, panel, point, scale) {
	put(letter, centeredOn(point, panel, scale));
}
