// @ts-check
/** The colours of tokens.css that the 3D view needs. */

const NAMES = /** @type {const} */ ([
	'sky', 'ground', 'grass', 'grass-stripe', 'line', 'goal', 'shadow', 'ball', 'best', 'ellipsoid', 'stem', 'valid', 'invalid',
]);

/** @typedef {Record<typeof NAMES[number], string> & {views: Record<string, string>}} Palette */

/** @returns {Palette} */
export function readPalette() {
	const style = getComputedStyle(document.documentElement);
	/** @param {string} name */
	const get = (name) => style.getPropertyValue(name).trim();
	const named = Object.fromEntries(NAMES.map((name) => [name, get(`--scene-${name}`)]));
	const views = Object.fromEntries(['a', 'b', 'c', 'd', 'e', 'f'].map((letter) => (
		[letter.toUpperCase(), get(`--scene-view-${letter}`)]
	)));
	return /** @type {Palette} */ ({ ...named, views });
}

/** @param {Palette} palette @param {string} letter */
export function colourOf(palette, letter) {
	return palette.views[letter] ?? palette.views.A;
}
