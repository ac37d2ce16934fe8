// @ts-check
/** The text of guidelines, with its pictures. */

import { html } from 'htm/preact';

import { pictureAddress } from '../api/independent_annotations.js';
import { partsOf } from '../lib/guideline_parts.js';
import { MarkdownBlocks } from './help/guide.js';

/** @param {{dataset: number, text: string}} props */
export function GuidelinesText({ dataset, text }) {
	return html`<div class="guide guidelines__text">${partsOf(text).map((part) => (
		part.digest ? html`<img src=${pictureAddress(dataset, part.digest)} alt=${part.text} />` : html`<${MarkdownBlocks} text=${part.text} />`
	))}</div>`;
}
