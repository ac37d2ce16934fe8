// @ts-check
/** The query text: words like `jac<0.95` and `sort:value`, added, replaced, taken away. */

/** @param {string} q @returns {string[]} words; quoted parts stay whole */
export function wordsOf(q) {
	return q.match(/(?:[^\s"]|"[^"]*")+/g) ?? [];
}

/** @param {string} word @returns {string} the field it speaks about, or "" */
function fieldOf(word) {
	return /^([a-z_0-9]+)(?::|<=|>=|<|>|=)/.exec(word)?.[1] ?? '';
}

/**
 * The query with every word of a field replaced.
 *
 * @param {string} q @param {string} field @param {string[]} replacement words, may be none
 * @returns {string}
 */
export function withField(q, field, replacement) {
	return [...wordsOf(q).filter((word) => fieldOf(word) !== field), ...replacement].join(' ');
}

/** What a query says about a field: `sort:value` -> "value". @param {string} q @param {string} field */
export function valueOf(q, field) {
	const word = wordsOf(q).find((candidate) => candidate.startsWith(`${field}:`));
	return word ? word.slice(field.length + 1) : '';
}

/**
 * The range that a query asks of a number: `jac>0.5 jac<0.9`.
 *
 * @param {string} q @param {string} field
 * @returns {{low: number | null, high: number | null}}
 */
export function rangeOf(q, field) {
	/** @type {{low: number | null, high: number | null}} */
	const range = { low: null, high: null };
	for (const word of wordsOf(q)) {
		const found = /^([a-z_]+)([<>])=?(-?[\d.]+)$/.exec(word);
		if (found?.[1] === field) range[found[2] === '<' ? 'high' : 'low'] = Number(found[3]);
	}
	return range;
}

/** What the rows of a query are remembered under. @param {string} dataset @param {string} q */
export function queueKey(dataset, q) {
	return `${dataset} ${q.trim()}`;
}
