// @ts-check
/** As much of Markdown as our own guide needs: headings, paragraphs, lists, tables, keys. */

/** @typedef {{kind: 'heading', level: number, text: string}} Heading */
/** @typedef {{kind: 'paragraph', text: string}} Paragraph */
/** @typedef {{kind: 'list', items: string[]}} List */
/** @typedef {{kind: 'table', rows: string[][]}} Table   the first row is the head */
/** @typedef {Heading | Paragraph | List | Table} Block */
/** @typedef {{kind: 'text' | 'key' | 'strong' | 'em', text: string}} Span */

const SPAN = /`([^`]+)`|\*\*([^*]+)\*\*|\*([^*]+)\*|!?\[([^\]]*)\]\([^)]*\)/g;

/** The blocks of a text; pictures are left out. @param {string} text @returns {Block[]} */
export function blocksOf(text) {
	return text.split(/\n{2,}/).flatMap((part) => blocksIn(part.split('\n').filter((line) => line.trim() !== '')));
}

/** @param {string[]} lines @returns {Block[]} */
function blocksIn(lines) {
	if (lines.length === 0 || lines[0].startsWith('![')) return [];
	const heading = /^(#+) (.*)$/.exec(lines[0]);
	if (heading) {
		const first = /** @type {Heading} */ ({ kind: 'heading', level: heading[1].length, text: heading[2] });
		return [first, ...blocksIn(lines.slice(1))];
	}
	if (lines[0].startsWith('|')) {
		const rows = lines.filter((line) => !/^[|\s:-]+$/.test(line));
		return [{ kind: 'table', rows: rows.map((line) => line.split('|').slice(1, -1).map((cell) => cell.trim())) }];
	}
	if (lines[0].startsWith('- ')) {
		const items = /** @type {string[]} */ ([]);
		for (const line of lines) {
			if (line.startsWith('- ')) items.push(line.slice(2));
			else items.push(`${items.pop()} ${line.trim()}`);
		}
		return [{ kind: 'list', items }];
	}
	return [{ kind: 'paragraph', text: lines.join(' ') }];
}

/** A line in pieces: keys, strong and emphasised words; of links the words alone. @param {string} text @returns {Span[]} */
export function spansOf(text) {
	/** @type {Span[]} */
	const spans = [];
	let at = 0;
	for (const found of text.matchAll(SPAN)) {
		if (found.index > at) spans.push({ kind: 'text', text: text.slice(at, found.index) });
		const [whole, key, strong, em, link] = found;
		const kind = key !== undefined ? 'key' : strong !== undefined ? 'strong' : em !== undefined ? 'em' : 'text';
		spans.push({ kind, text: key ?? strong ?? em ?? link });
		at = found.index + whole.length;
	}
	if (at < text.length) spans.push({ kind: 'text', text: text.slice(at) });
	return spans;
}
