// @ts-check
/** Names in a text: which one is begun before the caret, and the text once it is whole. */

const BEGUN = /(?:^|[^\w@.-])@([a-z0-9._-]*)$/i;
const MENTION = /(?<![\w@.-])@[a-z0-9](?:[a-z0-9._-]{0,38}[a-z0-9])?/gi;

/** The part of a name after an @ that ends at the caret; null: none is begun. @param {string} text @param {number} caret @returns {string | null} */
export function nameBefore(text, caret) {
	return BEGUN.exec(text.slice(0, caret))?.[1].toLowerCase() ?? null;
}

/** A text in which the name before the caret is whole. @param {string} text @param {number} caret @param {string} name @returns {{value: string, caret: number}} */
export function completed(text, caret, name) {
	const begun = nameBefore(text, caret) ?? '';
	const head = `${text.slice(0, caret - begun.length)}${name} `;
	return { value: head + text.slice(caret).replace(/^ /, ''), caret: head.length };
}

/**
 * A text in parts: what mentions one of some people, and what stands between.
 *
 * @param {string} text @param {readonly string[]} people
 * @returns {{text: string, mention: boolean}[]}
 */
export function partsOf(text, people) {
	const parts = [];
	let end = 0;
	for (const found of text.matchAll(MENTION)) {
		if (!people.includes(found[0].slice(1).toLowerCase())) continue;
		parts.push({ text: text.slice(end, found.index), mention: false }, { text: found[0], mention: true });
		end = found.index + found[0].length;
	}
	return [...parts, { text: text.slice(end), mention: false }].filter((part) => part.text);
}
