// @ts-check
/** Brightness and contrast of one view's frame. */

import { html } from 'htm/preact';

import { withValue } from '../lib/field.js';
import { adjust, adjustmentOf, RANGE, resetAdjustment } from '../state/adjustments.js';

/** @param {{letter: string, name: 'brightness' | 'contrast', label: string}} props */
function Slider({ letter, name, label }) {
	const value = adjustmentOf(letter)[name];
	return html`
		<label class="adjust__slider">
			<span>${label}</span>
			<input
				type="range" min=${RANGE.min} max=${RANGE.max} step=${RANGE.step} value=${value}
				onInput=${withValue((text) => adjust(letter, { [name]: Number(text) }))}
			/>
			<output>${Math.round(100 * value)} %</output>
		</label>
	`;
}

/** @param {{letter: string, onClose: () => void}} props */
export function AdjustPopover({ letter, onClose }) {
	/** @param {KeyboardEvent} event */
	function key(event) {
		if (event.key !== 'Escape') return;
		event.stopPropagation();
		event.preventDefault();
		onClose();
	}
	return html`
		<div class="adjust" role="group" aria-label=${`Brightness and contrast of view ${letter}`} onKeyDown=${key}>
			<${Slider} letter=${letter} name="brightness" label="Brightness" />
			<${Slider} letter=${letter} name="contrast" label="Contrast" />
			<p class="adjust__buttons">
				<button class="button" type="button" onClick=${() => resetAdjustment(letter)}>Reset</button>
				<button class="button" type="button" onClick=${onClose}>Close <kbd>Esc</kbd></button>
			</p>
		</div>
	`;
}
