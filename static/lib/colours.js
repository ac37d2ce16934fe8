// @ts-check
/** The colours of tokens.css for canvases, which cannot read custom properties themselves. */

import { signal } from '@preact/signals';

const NAMES = /** @type {const} */ ([
	'ok', 'warn', 'bad', 'muted', 'ink', 'halo', 'point', 'human', 'optimised', 'reprojected', 'predicted',
	'selected', 'plate', 'stage', 'field', 'grass', 'chalk', 'chalk-soft', 'unseen', 'grid',
]);
const LETTERS = ['a', 'b', 'c', 'd', 'e', 'f'];

/** @typedef {Record<typeof NAMES[number], string> & {views: string[]}} Colours */

/** @returns {Colours} */
function read() {
	const style = getComputedStyle(document.documentElement);
	/** @param {string} name */
	const get = (name) => style.getPropertyValue(name).trim();
	const named = Object.fromEntries(NAMES.map((name) => [name, get(`--canvas-${name}`)]));
	return /** @type {Colours} */ ({ ...named, views: LETTERS.map((letter) => get(`--view-${letter}`)) });
}

/** The colours as they are now; changes with the scheme. */
export const colours = signal(read());

for (const query of ['(prefers-color-scheme: dark)', '(prefers-contrast: more)']) {
	matchMedia(query).addEventListener('change', () => { colours.value = read(); });
}

/** The colour of a view by its letter. @param {string} letter @returns {string} */
export function viewColour(letter) {
	const index = LETTERS.indexOf(letter.toLowerCase());
	return colours.value.views[Math.max(0, index) % LETTERS.length];
}
