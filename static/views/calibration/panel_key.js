// @ts-check
/** The editor's zoom is kept apart from that of the review screen. */

/** @param {string} letter @returns {string} */
export function panelKey(letter) {
	return `editor ${letter}`;
}
