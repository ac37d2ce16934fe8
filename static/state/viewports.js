// @ts-check
/** Zoom and place of each panel, by letter; they stay from group to group. */

import { signal } from '@preact/signals';

import { centeredOn, fill, fit, inPanel, pan, zoomAbout } from '../geometry/viewport.js';
import { stored } from '../lib/storage.js';

/** @import {ImagePoint, ScreenPoint, Size, Viewport} from '../geometry/viewport.js' */

/** A panel without an entry shows its image as `filled` says. @type {import('@preact/signals').Signal<Record<string, {viewport: Viewport, panel: Size}>>} */
const viewports = signal({});

/** Whether images are cropped to fill their panels; else each is shown whole. */
export const filled = stored('panels-filled', false);

/**
 * @param {string} letter @param {Size} image @param {Size} panel
 * @param {ImagePoint | null} [center] what a cropped image shows in its middle; without it the image stays whole
 * @returns {Viewport}
 */
export function viewportOf(letter, image, panel, center) {
	const present = viewports.value[letter];
	if (present) return inPanel(present.viewport, present.panel, image, panel);
	return filled.value && center !== undefined ? fill(image, panel, center) : fit(image, panel);
}

/** Crop every image to its panel, or show all whole. */
export function toggleFilled() {
	filled.value = !filled.value;
	viewports.value = {};
}

/** @param {string} letter @param {Viewport} viewport @param {Size} panel */
function put(letter, viewport, panel) {
	const { width, height } = panel;
	viewports.value = { ...viewports.value, [letter]: { viewport, panel: { width, height } } };
}

/** Whether somebody zoomed or moved a panel. @param {string} letter */
export function isZoomed(letter) {
	return letter in viewports.value;
}

/** Give a panel the view back that it had before somebody zoomed. @param {string} letter */
export function fitPanel(letter) {
	const { [letter]: _, ...rest } = viewports.value;
	viewports.value = rest;
}

/** Leave the zoom of every panel. */
export function fitAll() {
	viewports.value = {};
}

/**
 * @param {string} letter @param {Size} image @param {Size} panel @param {ScreenPoint} at
 * @param {number} factor @param {ImagePoint | null} [center] as for `viewportOf`
 */
export function zoomPanel(letter, image, panel, at, factor, center) {
	const next = zoomAbout(viewportOf(letter, image, panel, center), at, factor, image, panel);
	const cropped = filled.value && center !== undefined;
	if (!cropped && next.scale <= fit(image, panel).scale * 1.001) fitPanel(letter);
	else put(letter, next, panel);
}

/**
 * @param {string} letter @param {Size} image @param {Size} panel @param {number} dx @param {number} dy
 * @param {ImagePoint | null} [center] as for `viewportOf`
 */
export function panPanel(letter, image, panel, dx, dy, center) {
	const present = viewportOf(letter, image, panel, center);
	const next = pan(present, dx, dy, image, panel);
	// A whole image has nowhere to go.
	if (next.left !== present.left || next.top !== present.top) put(letter, next, panel);
}

/**
 * Show a place of this group; unlike a person's own zoom it does not stay for the next one.
 *
 * @param {string} letter @param {Size} panel @param {ImagePoint} point @param {number} scale
 */
export function zoomTo(letter, panel, point, scale) {
	put(letter, centeredOn(point, panel, scale), panel);
	lent.add(letter);
}

/** Panels whose zoom belongs to one place of one group. @type {Set<string>} */
const lent = new Set();

/** Show those panels again as they were shown before. */
export function returnLent() {
	for (const letter of lent) fitPanel(letter);
	lent.clear();
}
