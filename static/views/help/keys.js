// @ts-check
/** The keys, written from the bindings themselves; they are chosen here too. */

import { html } from 'htm/preact';
import { useLayoutEffect, useRef, useState } from 'preact/hooks';

import { page } from '../../lib/router.js';
import {
	activeBindings, chooseKey, chordOf, chosenKeys, idOf, isEditable, keysOf, lettersOn, written,
} from '../../lib/keys.js';

/** @import {Binding} from '../../lib/keys.js' */

/** Headings in the order of the work; others follow as they come. */
const ORDER = ['Verdict', 'Navigate', 'View', 'Edit'];
const REVIEWING = ' The wheel zooms about the pointer, dragging the picture pans, a double click shows one view alone. Drag a line point or the ball to move it; select the ball to resize its box by the corners. Corner brackets with a score are predictions: they are not used until you accept them.';
const MODIFIERS = new Set(['Shift', 'Control', 'Alt', 'Meta']);

/** @param {Binding} binding @returns {string[]} */
function shownKeys(binding) {
	return binding.shown ? [binding.shown] : keysOf(binding).map(written);
}

/** @param {string} group */
function placeOf(group) {
	const place = ORDER.indexOf(group);
	return place === -1 ? ORDER.length : place;
}

/** @param {readonly Binding[]} bindings @returns {[string, Binding[]][]} */
function grouped(bindings) {
	/** @type {Map<string, Binding[]>} */
	const groups = new Map();
	for (const binding of bindings) {
		if (binding.shown === 'hidden') continue;
		groups.set(binding.group, [...(groups.get(binding.group) ?? []), binding]);
	}
	return [...groups].sort(([a], [b]) => placeOf(a) - placeOf(b));
}

/** A binding whose key is being chosen. @param {{binding: Binding, onEnd: () => void}} props */
function KeyField({ binding, onEnd }) {
	const [taken, setTaken] = useState('');
	const field = useRef(/** @type {HTMLButtonElement | null} */ (null));
	useLayoutEffect(() => field.current?.focus(), []);
	/** @param {KeyboardEvent} event */
	function key(event) {
		if (event.key === 'Tab' || MODIFIERS.has(event.key)) return;
		event.preventDefault();
		event.stopPropagation();
		if (event.key === 'Escape') {
			onEnd();
			return;
		}
		const holder = chooseKey(binding, chordOf(event));
		if (holder) setTaken(`${written(chordOf(event))} is “${holder.label}”`);
		else onEnd();
	}
	return html`
		<button class="key-field" type="button" ref=${field} onKeyDown=${key} onBlur=${onEnd} aria-label=${`Press the key for “${binding.label}”`}>
			${taken || 'Press a key…'}
		</button>
	`;
}

/** @param {{binding: Binding, chosen: string | null, onChoose: (id: string | null) => void}} props */
function KeyRow({ binding, chosen, onChoose }) {
	const id = idOf(binding);
	const own = id in chosenKeys.value;
	return html`
		<div>
			<dt>${chosen === id ? html`<${KeyField} binding=${binding} onEnd=${() => onChoose(null)} />`
				: shownKeys(binding).map((keys) => (isEditable(binding)
					? html`<button class="key" type="button" title="Choose another key" aria-label=${`${keys}: choose another key for “${binding.label}”`} onClick=${() => onChoose(id)}><kbd>${keys}</kbd></button>`
					: html`<kbd>${keys}</kbd> `))}</dt>
			<dd>${binding.label}${own ? html` <button class="link-button" type="button" onClick=${() => chooseKey(binding, null)}>reset</button>` : null}</dd>
		</div>
	`;
}

/** @param {{bindings?: readonly Binding[]}} props by default those of the page */
export function Keys({ bindings }) {
	const [chosen, setChosen] = useState(/** @type {string | null} */ (null));
	return html`
		<label class="help__switch">
			<input type="checkbox" checked=${lettersOn.value} onChange=${() => { lettersOn.value = !lettersOn.value; }} />
			Use single-letter keys
		</label>
		<div class="help">
			${grouped(bindings ?? activeBindings()).map(([name, members]) => html`
				<section key=${name}>
					<h3>${name}</h3>
					<dl>${members.map((binding) => html`<${KeyRow} key=${idOf(binding)} binding=${binding} chosen=${chosen} onChoose=${setChosen} />`)}</dl>
				</section>`)}
		</div>
		<p class="help__note">Click a key to choose another.${bindings || page.value.page === 'review' ? REVIEWING : ''}</p>
	`;
}
