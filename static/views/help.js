// @ts-check
/** The page of keys, written from the bindings themselves. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { activeBindings } from '../lib/keys.js';
import { helpOpen } from '../state/workspace.js';

/** @import {Binding} from '../lib/keys.js' */

const SYMBOLS = /** @type {Record<string, string>} */ ({
	Escape: 'Esc', Delete: 'Del', ArrowUp: '↑', ArrowDown: '↓', Backspace: '⌫',
});

/** @param {string} chord */
function written(chord) {
	return chord.split('+').map((key) => SYMBOLS[key] ?? (key.length === 1 ? key.toUpperCase() : key)).join(' ');
}

/** @param {Binding} binding @returns {string[]} */
function shownKeys(binding) {
	return binding.shown ? [binding.shown] : binding.keys.map(written);
}

/** @returns {Map<string, Binding[]>} */
function grouped() {
	/** @type {Map<string, Binding[]>} */
	const groups = new Map();
	for (const binding of activeBindings()) {
		if (binding.shown === 'hidden') continue;
		groups.set(binding.group, [...(groups.get(binding.group) ?? []), binding]);
	}
	return groups;
}

function KeyPage() {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	useEffect(() => dialog.current?.showModal(), []);
	return html`
		<dialog class="dialog dialog--wide" ref=${dialog} aria-labelledby="help-title" onClose=${() => { helpOpen.value = false; }}>
			<header class="dialog__header">
				<h2 id="help-title">Keys</h2>
				<form method="dialog"><button class="button" type="submit">Close <kbd>Esc</kbd></button></form>
			</header>
			<div class="help">
				${[...grouped()].map(([name, bindings]) => html`
					<section key=${name}>
						<h3>${name}</h3>
						<dl>
							${bindings.map((binding) => html`
								<div><dt>${shownKeys(binding).map((keys) => html`<kbd>${keys}</kbd> `)}</dt><dd>${binding.label}</dd></div>`)}
						</dl>
					</section>`)}
			</div>
			<p class="help__note">Wheel zooms about the pointer, dragging the picture pans, a double click shows one view alone. Drag a line point or the ball to move it; select the ball to resize its box by the corners.</p>
		</dialog>
	`;
}

export function Help() {
	return helpOpen.value ? html`<${KeyPage} />` : null;
}
