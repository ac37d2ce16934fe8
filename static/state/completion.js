// @ts-check
/** What the query box offers while one types: fields, operators and values. */

/** @typedef {{text: string, label: string, hint: string}} Offer   `text` replaces the word */
/** @typedef {{from: number, to: number, offers: Offer[]}} Completion */
/** @typedef {{[field: string]: string[]}} Facets   values that a dataset has: split, match, reviewer */

/** @import {QueryField} from '../api/queue.js' */

const MOST = 14;

/**
 * What may stand at the caret.
 *
 * @param {string} text @param {number} caret @param {Facets} facets @param {QueryField[]} fields all that a query can ask
 * @returns {Completion}
 */
export function complete(text, caret, facets, fields) {
	const before = text.slice(0, caret);
	// A word goes back to the last space outside quotes.
	const word = /(?:[^\s"]|"[^"]*"?)*$/.exec(before)?.[0] ?? '';
	const from = caret - word.length;
	const to = caret + (/^[^\s"]*/.exec(text.slice(caret))?.[0].length ?? 0);
	const minus = word.startsWith('-') ? '-' : '';
	const found = /^([a-z_]+):(.*)$/.exec(word.slice(minus.length));
	const offers = found ? valueOffers(minus, found[1], found[2], facets, fields) : fieldOffers(minus, word.slice(minus.length), fields);
	return { from, to, offers: offers.slice(0, MOST) };
}

/** @param {string} minus @param {string} start @param {QueryField[]} fields @returns {Offer[]} */
function fieldOffers(minus, start, fields) {
	const asked = fields.filter(({ kind }) => !minus || (kind !== 'number' && kind !== 'order'));
	const offers = asked.flatMap(({ name, kind, meaning, unit }) => {
		const hint = unit ? `${meaning}, ${unit}` : meaning;
		return (kind === 'number' ? ['<', '>'] : [':']).map((operator) => ({ text: `${minus}${name}${operator}`, label: `${minus}${name}${operator}`, hint }));
	});
	return offers.filter(({ text }) => text.startsWith(minus + start) && text !== start);
}

/** @param {string} minus @param {string} name @param {string} start @param {Facets} facets @param {QueryField[]} fields @returns {Offer[]} */
function valueOffers(minus, name, start, facets, fields) {
	const field = fields.find((one) => one.name === name || one.also.includes(name));
	const known = [...(facets[field?.name ?? name] ?? []), ...(field?.values ?? [])];
	const comma = start.lastIndexOf(',') + 1;
	const [chosen, last] = [start.slice(0, comma), start.slice(comma).replaceAll('"', '').toLowerCase()];
	return known
		.filter((value) => value.toLowerCase().includes(last) && value !== start)
		.sort((a, b) => Number(!a.toLowerCase().startsWith(last)) - Number(!b.toLowerCase().startsWith(last)))
		.map((value) => {
			const quoted = /[\s"]/.test(value) ? `"${value}"` : value;
			return { text: `${minus}${name}:${chosen}${quoted} `, label: value, hint: '' };
		});
}
