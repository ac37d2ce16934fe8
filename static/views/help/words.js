// @ts-check
/** The glossary, with a field that finds. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { withValue } from '../../lib/field.js';
import { useResource } from '../../lib/resource.js';
import { loadGlossary } from '../../state/glossary.js';

/** @import {Section} from '../../state/glossary.js' */

/** The sections with only those words that hold the text. @param {Section[]} sections @param {string} text */
function found(sections, text) {
	const asked = text.trim().toLowerCase();
	return sections.map((section) => ({
		...section, words: section.words.filter(({ word, meaning }) => `${word} ${meaning}`.toLowerCase().includes(asked)),
	})).filter(({ words }) => words.length > 0);
}

export function Words() {
	const { value, error } = useResource(loadGlossary, []);
	const [text, setText] = useState('');
	const sections = found(value ?? [], text);
	return html`
		<p class="help-words__find">
			<label for="find-word">Find a word</label>
			<input
				id="find-word" class="field" type="search" autocomplete="off" spellcheck=${false} value=${text}
				onInput=${withValue(setText)}
			/>
			<span class="note">In tables and gates, rest on an underlined word (or reach it with Tab) to read what it means.</span>
		</p>
		${error ? html`<p role="alert">The glossary could not be read. Is the server still running?</p>` : null}
		${value && sections.length === 0 ? html`<p class="empty-note" role="status">No word matches.</p>` : null}
		<div class="help-words">
			${sections.map(({ name, title, intro, words }) => html`
				<section key=${name}>
					<h3>${title}</h3>
					${intro ? html`<p class="note">${intro.replaceAll('`', '')}</p>` : null}
					<dl>${words.map(({ id, word, meaning }) => html`<div key=${id}><dt>${word}</dt><dd>${meaning.replaceAll('`', '')}</dd></div>`)}</dl>
				</section>`)}
		</div>
	`;
}
