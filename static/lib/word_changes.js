// @ts-check
/** What differs between two texts, word by word. */

/** @typedef {{kind: 'same' | 'gone' | 'new', text: string}} Change */

/** Words with the blanks behind them, so that they join to the text again. @param {string} text @returns {string[]} */
const wordsOf = (text) => text.match(/\s*\S+\s*?(?=\s|$)|\s+/g) ?? [];

/** Beyond so many pairs of words the middle is shown as replaced. */
const MOST_PAIRS = 4_000_000;

/**
 * The shortest way from one text to another: what stays, goes and comes, in order.
 *
 * @param {string} before @param {string} after @returns {Change[]}
 */
export function wordChanges(before, after) {
	const [a, b] = [wordsOf(before), wordsOf(after)];
	let start = 0;
	while (start < a.length && start < b.length && a[start] === b[start]) start += 1;
	let end = 0;
	while (end < a.length - start && end < b.length - start && a[a.length - 1 - end] === b[b.length - 1 - end]) end += 1;
	const middle = between(a.slice(start, a.length - end), b.slice(start, b.length - end));
	return joined([...a.slice(0, start).map(same), ...middle, ...a.slice(a.length - end).map(same)]);
}

/** @param {string} text @returns {Change} */
const same = (text) => ({ kind: 'same', text });

/** By the longest common subsequence. @param {string[]} a @param {string[]} b @returns {Change[]} */
function between(a, b) {
	/** @type {Change[]} */
	const found = [];
	const width = b.length + 1;
	const kept = a.length * b.length <= MOST_PAIRS;
	const longest = new Uint32Array(kept ? (a.length + 1) * width : 0);
	if (kept) {
		for (let i = a.length - 1; i >= 0; i -= 1) {
			for (let j = b.length - 1; j >= 0; j -= 1) {
				longest[i * width + j] = a[i] === b[j] ? longest[(i + 1) * width + j + 1] + 1 : Math.max(longest[(i + 1) * width + j], longest[i * width + j + 1]);
			}
		}
	}
	let [i, j] = [0, 0];
	while (i < a.length || j < b.length) {
		if (kept && i < a.length && j < b.length && a[i] === b[j]) {
			found.push(same(a[i]));
			i += 1;
			j += 1;
		} else if (i < a.length && (j === b.length || !kept || longest[(i + 1) * width + j] >= longest[i * width + j + 1])) {
			found.push({ kind: 'gone', text: a[i] });
			i += 1;
		} else {
			found.push({ kind: 'new', text: b[j] });
			j += 1;
		}
	}
	return found;
}

/** Neighbours of one kind are one change. @param {Change[]} changes @returns {Change[]} */
function joined(changes) {
	/** @type {Change[]} */
	const found = [];
	for (const { kind, text } of changes) {
		const last = found.at(-1);
		if (last?.kind === kind) last.text += text;
		else found.push({ kind, text });
	}
	return found;
}
