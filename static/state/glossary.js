// @ts-check
/** The glossary: every word of the product with what it means, read when somebody first asks. */

import { getOwn } from '../api/client.js';

/** @typedef {{id: string, word: string, meaning: string}} Word */
/** @typedef {{name: string, title: string, intro?: string, words: Word[]}} Section */

/** @type {Promise<Section[]> | null} */
let asked = null;

/** All sections, in order. @returns {Promise<Section[]>} */
export function loadGlossary() {
	asked ??= getOwn(new URL('../help/glossary.json', import.meta.url).href).then(({ sections }) => sections);
	// Whoever asks again after a failure gets another chance.
	asked.catch(() => { asked = null; });
	return asked;
}

/** What a word means; "" for one that the glossary does not have. @param {string} id @returns {Promise<string>} */
export async function meaningOf(id) {
	const sections = await loadGlossary();
	return sections.flatMap(({ words }) => words).find((word) => word.id === id)?.meaning ?? '';
}
