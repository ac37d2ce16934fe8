// @ts-check
/** The colours of tokens.css that the 3D view needs. */

import { tokens } from '../../lib/css_values.js';

const NAMES = /** @type {const} */ ([
	'sky', 'ground', 'grass', 'grass-stripe', 'line', 'goal', 'shadow', 'ball', 'best', 'ellipsoid', 'stem', 'valid', 'invalid',
]);

const LETTERS = /** @type {const} */ (['a', 'b', 'c', 'd', 'e', 'f']);

/** @typedef {Record<typeof NAMES[number], string> & {views: Record<string, string>}} Palette   `views`: by small letter */

/** @returns {Palette} */
export function readPalette() {
	return { ...tokens(NAMES, 'scene-'), views: tokens(LETTERS, 'scene-view-') };
}

/** @param {Palette} palette @param {string} letter */
export function colourOf({ views }, letter) {
	return views[letter.toLowerCase()] ?? views.a;
}
