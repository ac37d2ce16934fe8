// @ts-check
/** Brightness and contrast of each view, by letter; they stay from group to group. */

import { stored } from '../lib/storage.js';

/** @typedef {{brightness: number, contrast: number}} Adjustment   1 leaves the frame as it is */

/** @type {Adjustment} */
const PLAIN = { brightness: 1, contrast: 1 };
/** Least, most and step of both. */
export const RANGE = { min: 0.4, max: 2.6, step: 0.05 };

const adjustments = stored('adjustments', /** @type {Record<string, Adjustment>} */ ({}));

/** @param {string} letter @returns {Adjustment} */
export function adjustmentOf(letter) {
	return adjustments.value[letter] ?? PLAIN;
}

/** @param {string} letter @param {Partial<Adjustment>} change */
export function adjust(letter, change) {
	adjustments.value = { ...adjustments.value, [letter]: { ...adjustmentOf(letter), ...change } };
}

/** Show a view's frame as it is. @param {string} letter */
export function resetAdjustment(letter) {
	const { [letter]: _, ...rest } = adjustments.value;
	adjustments.value = rest;
}

/** The adjustment as a CSS filter; "none" where there is none. @param {string} letter */
export function filterOf(letter) {
	const { brightness, contrast } = adjustmentOf(letter);
	return brightness === 1 && contrast === 1 ? 'none' : `brightness(${brightness}) contrast(${contrast})`;
}
