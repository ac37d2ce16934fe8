// @ts-check
/** One histogram for each number; dragging over it, or moving its two ends by keyboard, asks for that range. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { rangeOf, withField } from '../state/query.js';
import { summary } from '../state/queue.js';

/** @import {Histogram} from '../api/types.js' */

/** `beyond`: the last bin also holds what is larger, so it has no upper end. */
const COLUMNS = [
	{ name: 'jac', field: 'jac', label: 'min JaC 0.5 %', digits: 2, beyond: false },
	{ name: 'error_percent', field: 'error_percent', label: 'ball error, % diagonal', digits: 2, beyond: true },
	{ name: 'sigma', field: 'sigma', label: 'σ, m', digits: 2, beyond: true },
	{ name: 'parallax', field: 'parallax', label: 'parallax, °', digits: 0, beyond: false },
	{ name: 'size_ratio', field: 'size_ratio', label: 'ball Ø ratio', digits: 2, beyond: true },
];
const WIDTH = 200;
const HEIGHT = 44;

/** @typedef {typeof COLUMNS[number]} Column */

/** @param {number} value @param {number} digits */
function short(value, digits) {
	return String(Number(value.toFixed(digits)));
}

/** The words of a query that ask for the bins from `first` to `last`. @param {Column} column @param {Histogram} data @param {number} first @param {number} last */
function wordsFor(column, { low, high, counts }, first, last) {
	const width = (high - low) / counts.length;
	const from = `${column.field}>=${short(low + first * width, 3)}`;
	const to = `${column.field}<=${short(low + (last + 1) * width, 3)}`;
	return column.beyond && last === counts.length - 1 ? [from] : [from, to];
}

/** The bins that a query asks for. @param {Column} column @param {Histogram} data @param {string} q @returns {[number, number]} */
function binsOf(column, { low, high, counts }, q) {
	const range = rangeOf(q, column.field);
	const bin = (/** @type {number} */ value) => ((value - low) / (high - low)) * counts.length;
	const first = range.low === null ? 0 : Math.round(bin(range.low));
	const last = range.high === null ? counts.length - 1 : Math.round(bin(range.high)) - 1;
	const clamp = (/** @type {number} */ value) => Math.max(0, Math.min(counts.length - 1, value));
	return [clamp(first), Math.max(clamp(first), clamp(last))];
}

/** The two ends of the range for the keyboard. @param {{column: Column, data: Histogram, bins: [number, number], choose: (first: number, last: number) => void}} props */
function Ends({ column, data, bins, choose }) {
	const most = data.counts.length - 1;
	const width = (data.high - data.low) / data.counts.length;
	/** @param {number} at @param {boolean} upper */
	const said = (at, upper) => short(data.low + (at + (upper ? 1 : 0)) * width, column.digits);
	const value = (/** @type {Event} */ event) => Number(/** @type {HTMLInputElement} */ (event.target).value);
	return html`
		<input
			class="histogram__end" type="range" min="0" max=${most} step="1" value=${bins[0]} aria-label=${`${column.label} from`}
			aria-valuetext=${said(bins[0], false)} onChange=${(/** @type {Event} */ event) => choose(Math.min(value(event), bins[1]), bins[1])}
		/>
		<input
			class="histogram__end" type="range" min="0" max=${most} step="1" value=${bins[1]} aria-label=${`${column.label} to`}
			aria-valuetext=${said(bins[1], true)} onChange=${(/** @type {Event} */ event) => choose(bins[0], Math.max(value(event), bins[0]))}
		/>
	`;
}

/**
 * @param {{column: Column, data: Histogram, q: string, onQuery: (q: string) => void}} props
 */
function OneHistogram({ column, data, q, onQuery }) {
	const [brush, setBrush] = useState(/** @type {[number, number] | null} */ (null));
	const { counts, low, high } = data;
	const most = Math.max(1, ...counts);
	const step = WIDTH / counts.length;
	const bins = binsOf(column, data, q);
	const [first, last] = brush ? [Math.min(...brush), Math.max(...brush)] : bins;
	/** @param {PointerEvent} event */
	const binAt = (event) => {
		const box = /** @type {Element} */ (event.currentTarget).getBoundingClientRect();
		const bin = Math.floor(((event.clientX - box.left) / box.width) * counts.length);
		return Math.max(0, Math.min(counts.length - 1, bin));
	};
	/** @param {number} from @param {number} to */
	function choose(from, to) {
		const whole = from === 0 && to === counts.length - 1;
		onQuery(withField(q, column.field, whole ? [] : wordsFor(column, data, from, to)));
	}
	/** @param {PointerEvent} event */
	function down(event) {
		/** @type {Element} */ (event.currentTarget).setPointerCapture(event.pointerId);
		setBrush([binAt(event), binAt(event)]);
	}
	/** @param {PointerEvent} event */
	function move(event) {
		if (brush) setBrush([brush[0], binAt(event)]);
	}
	function up() {
		if (!brush) return;
		setBrush(null);
		choose(first, last);
	}
	const range = rangeOf(q, column.field);
	const filtered = range.low !== null || range.high !== null;
	return html`
		<section class="card histogram" aria-label=${column.label}>
			<h2>${column.label}${filtered ? html`<button type="button" class="histogram__clear" onClick=${() => onQuery(withField(q, column.field, []))}>clear<span class="hidden-text"> ${column.label}</span></button>` : null}</h2>
			<svg
				viewBox=${`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" role="img"
				aria-label=${`${column.label} from ${short(low, column.digits)} to ${short(high, column.digits)}`}
				onPointerDown=${down} onPointerMove=${move} onPointerUp=${up} onPointerCancel=${() => setBrush(null)}
			>
				${counts.map((n, bin) => {
					const tall = n === 0 ? 1 : Math.max(2, (n / most) * HEIGHT);
					return html`<rect key=${bin} data-inside=${bin >= first && bin <= last} x=${bin * step + 0.8} y=${HEIGHT - tall} width=${step - 1.6} height=${tall} rx="0.8" />`;
				})}
			</svg>
			<p class="histogram__ends"><span>${short(low, column.digits)}</span><span>${short(high, column.digits)}${column.beyond ? '+' : ''}</span></p>
			<${Ends} column=${column} data=${data} bins=${bins} choose=${choose} />
		</section>
	`;
}

/** @param {{q: string, onQuery: (q: string) => void}} props */
export function Histograms({ q, onQuery }) {
	const histograms = summary.value?.histograms ?? {};
	return html`
		${COLUMNS.map((column) => {
			const data = histograms[column.name];
			return data
				? html`<${OneHistogram} key=${column.name} column=${column} data=${data} q=${q} onQuery=${onQuery} />`
				: html`<section key=${column.name} class="card histogram" aria-busy="true"><h2>${column.label}</h2><svg></svg><p class="histogram__ends">–</p></section>`;
		})}
	`;
}
