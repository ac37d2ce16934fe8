// @ts-check
/** One threshold: a slider and the number beside it; some can be switched off. */

import { html } from 'htm/preact';

import { withTick, withValue } from '../lib/field.js';

/** @import {PolicyField, Threshold as Value} from '../api/policies.js' */

const OFF = 'This threshold is off: tick the box to use it';

/** What becomes of a value that equals its threshold. */
const COMPARISONS = /** @type {{[comparison: string]: string}} */ ({
	'more than': 'Passes above this value; one that equals it does not, as in the paper', 'at least': 'Passes from this value on', 'at most': 'Passes up to this value',
});

/** Units that stand beside a number in few characters. */
const UNITS = /** @type {{[unit: string]: string}} */ ({ '% of diagonal': '%', degrees: '°', share: '' });

/** @param {{unit: string}} props */
function Unit({ unit }) {
	return html`<span class="threshold__unit" title=${unit}>${UNITS[unit] ?? unit.split(' ')[0]}</span>`;
}

/** A round step, about two hundred from end to end. @param {number} low @param {number} high */
function stepOf(low, high) {
	const rough = (high - low) / 200;
	const power = 10 ** Math.floor(Math.log10(rough));
	const round = [1, 2, 5, 10].find((n) => n * power >= rough * 0.999) ?? 10;
	return Number((round * power).toPrecision(1));
}

/** @param {PolicyField} field @returns {[number, number]} */
function endsOf({ minimum, maximum, default: usual }) {
	const low = minimum ?? 0;
	const high = maximum ?? Math.max(1, 4 * Number(usual ?? 1));
	return [low, high];
}

/** @param {{field: PolicyField, value: Value, id: string, change: (value: Value) => void}} props */
function Slider({ field, value, id, change }) {
	const [low, high] = endsOf(field);
	const shown = typeof value === 'number' ? value : low;
	const off = value === null;
	const share = Math.max(0, Math.min(1, (shown - low) / (high - low)));
	/** A number within the limits; where none is left, the one that was there. @param {Event} event */
	function type({ target }) {
		const box = /** @type {HTMLInputElement} */ (target);
		const typed = box.value.trim() && Number.isFinite(Number(box.value)) ? Math.max(low, Math.min(high, Number(box.value))) : shown;
		box.value = String(typed);
		if (typed !== shown) change(typed);
	}
	return html`
		<input
			class="threshold__slider" type="range" min=${low} max=${high} step=${stepOf(low, high)} value=${shown} disabled=${off} title=${off ? OFF : ''}
			aria-label=${`${field.label}, slider`} style=${{ '--share': `${100 * share}%` }}
			onInput=${withValue((text) => change(Number(text)))}
		/>
		<input
			class="field threshold__number" id=${id} type="number" min=${low} max=${high} step="any" value=${off ? '' : shown} disabled=${off} title=${off ? OFF : ''}
			onChange=${type}
		/>
		<${Unit} unit=${field.unit} />
	`;
}

/** What a choice is called, where it is a word of the policy's. */
const CHOICES = /** @type {{[name: string]: string}} */ ({ mean: 'pair average', best: 'most likely point', lines: 'annotated lines', paint: 'paint in the picture', fixed: 'as set here', estimated: 'from the dataset', exact: 'as set here', professional: 'professional pitch', any: 'any, or stretched', inner: 'inner edges', middle: 'middle', laws: 'as in the Laws', points: 'each point', markings: 'each marking' });

/** @param {{field: PolicyField, id: string, value: Value, change: (value: Value) => void}} props */
function Choice({ field, id, value, change }) {
	const chosen = (/** @type {string} */ text) => (typeof field.default === 'string' ? text : Number(text));
	return html`
		<select class=${`field threshold__${typeof field.default === 'string' ? 'words' : 'number'}`} id=${id} value=${String(value)} onChange=${withValue((text) => change(chosen(text)))}>
			${field.choices.map((option) => html`<option key=${option} value=${String(option)}>${CHOICES[option] ?? option}</option>`)}
		</select>
		<${Unit} unit=${field.unit} />
	`;
}

/**
 * @param {{
 *   field: PolicyField, value: Value, present: Value, switched: Value,
 *   change: (value: Value) => void, idle: string
 * }} props `idle`: why it changes nothing here; `present` is what the saved policy asks; `switched` what is asked when it is switched on
 */
export function Threshold({ field, value, present, switched, change, idle }) {
	const id = `threshold-${field.name.replace('.', '-')}`;
	const changed = value !== present;
	if (typeof field.default === 'boolean') {
		return html`
			<div class="threshold" data-changed=${changed}>
				<label class="form__check"><input type="checkbox" checked=${value === true} onChange=${withTick(change)} />${field.label}</label>
			</div>
		`;
	}
	return html`
		<div class="threshold" data-changed=${changed}>
			<label class="threshold__label" for=${id} title=${COMPARISONS[field.comparison ?? ''] ?? ''}>${field.label}${idle ? html`<small class="threshold__idle">${idle}</small>` : null}</label>
			${field.optional ? html`
				<label class="threshold__switch">
					<input type="checkbox" checked=${value !== null} onChange=${withTick((ticked) => change(ticked ? switched : null))} />
					<span class="hidden-text">Use the threshold “${field.label}”</span>
				</label>` : null}
			${field.choices.length
				? html`<${Choice} field=${field} id=${id} value=${value} change=${change} />`
				: html`<${Slider} field=${field} id=${id} value=${value} change=${change} />`}
		</div>
	`;
}
