// @ts-check
/** The colours of tokens.css for canvases, which cannot read custom properties themselves. */

import { followed, tokens } from './css_values.js';

const NAMES = /** @type {const} */ ([
	'ok', 'warn', 'bad', 'muted', 'ink', 'halo', 'point', 'human', 'optimised', 'reprojected', 'predicted',
	'selected', 'plate', 'stage', 'field', 'grass', 'chalk', 'chalk-soft', 'unseen', 'grid',
]);
const LETTERS = ['a', 'b', 'c', 'd', 'e', 'f'];

/** @typedef {Record<typeof NAMES[number], string> & {views: string[]}} Colours */

/** @returns {Colours} */
function read() {
	return { ...tokens(NAMES, 'canvas-'), views: Object.values(tokens(LETTERS, 'view-')) };
}

/** The colours as they are now; changes with the scheme. */
export const colours = followed(read);

/** The colour of a view by its letter. @param {string} letter @returns {string} */
export function viewColour(letter) {
	const index = LETTERS.indexOf(letter.toLowerCase());
	return colours.value.views[Math.max(0, index) % LETTERS.length];
}
