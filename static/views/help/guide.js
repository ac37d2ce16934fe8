// @ts-check
/** The review guide: the same text as docs/review-guide.md, without its pictures. */

import { html } from 'htm/preact';

import { getOwn } from '../../api/client.js';
import { useResource } from '../../lib/resource.js';
import { blocksOf, spansOf } from '../../lib/markdown.js';

/** @import {Block} from '../../lib/markdown.js' */

/** @param {{text: string}} props */
function Inline({ text }) {
	return spansOf(text).map(({ kind, text: words }) => (
		kind === 'key' ? html`<kbd>${words}</kbd>`
			: kind === 'strong' ? html`<strong>${words}</strong>`
				: kind === 'em' ? html`<em>${words}</em>` : words
	));
}

/** @param {{block: Block}} props */
function Part({ block }) {
	if (block.kind === 'heading') return html`<h3>${block.text}</h3>`;
	if (block.kind === 'list') return html`<ul>${block.items.map((item) => html`<li><${Inline} text=${item} /></li>`)}</ul>`;
	if (block.kind === 'paragraph') return html`<p><${Inline} text=${block.text} /></p>`;
	const [head, ...rows] = block.rows;
	return html`
		<table class="table">
			<thead><tr>${head.map((cell) => html`<th scope="col">${cell}</th>`)}</tr></thead>
			<tbody>${rows.map((row) => html`<tr>${row.map((cell) => html`<td><${Inline} text=${cell} /></td>`)}</tr>`)}</tbody>
		</table>
	`;
}

/** A text in Markdown. @param {{text: string}} props */
export function MarkdownBlocks({ text }) {
	return blocksOf(text).map((block) => html`<${Part} block=${block} />`);
}

/** The page has the title already. @param {string} text */
const withoutTitle = (text) => text.replace(/^# .*\n/, '');

export function Guide() {
	const { value, error } = useResource(() => getOwn(new URL('../../help/guide.json', import.meta.url).href), []);
	if (error) return html`<p role="alert">The guide could not be read. Is the server still running?</p>`;
	return html`<div class="guide">${value ? html`<${MarkdownBlocks} text=${withoutTitle(value.text)} />` : null}</div>`;
}
