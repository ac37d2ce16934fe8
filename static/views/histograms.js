// @ts-check
/** One histogram for each number; dragging over it asks for that range. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { rangeOf, withField } from '../state/query.js';
import { summary } from '../state/queue.js';

/** @import {Histogram} from '../api/types.js' */

const COLUMNS = [
	{ name: 'jac', field: 'jac', label: 'min JaC 0.5 %', digits: 2 },
	{ name: 'error_percent', field: 'error_percent', label: 'ball error, % diagonal', digits: 2 },
	{ name: 'sigma', field: 'sigma', label: 'σ, m', digits: 2 },
	{ name: 'parallax', field: 'parallax', label: 'parallax, °', digits: 0 },
	{ name: 'size_ratio', field: 'size_ratio', label: 'ball Ø ratio', digits: 2 },
];
const WIDTH = 200;
const HEIGHT = 44;

/** @param {number} value @param {number} digits */
function short(value, digits) {
	return String(Number(value.toFixed(digits)));
}

/**
 * @param {{
 *   column: typeof COLUMNS[number], data: Histogram, q: string, onQuery: (q: string) => void
 * }} props
 */
function OneHistogram({ column, data, q, onQuery }) {
	const [brush, setBrush] = useState(/** @type {[number, number] | null} */ (null));
	const { counts, low, high } = data;
	const most = Math.max(1, ...counts);
	const step = WIDTH / counts.length;
	const range = rangeOf(q, column.field);
	const width = (high - low) / counts.length;
	/** @param {number} bin */
	const inside = (bin) => {
		if (brush) return bin >= Math.min(...brush) && bin <= Math.max(...brush);
		const middle = low + (bin + 0.5) * width;
		return (range.low === null || middle >= range.low) && (range.high === null || middle <= range.high);
	};
	/** @param {PointerEvent} event */
	const binAt = (event) => {
		const box = /** @type {Element} */ (event.currentTarget).getBoundingClientRect();
		const bin = Math.floor(((event.clientX - box.left) / box.width) * counts.length);
		return Math.max(0, Math.min(counts.length - 1, bin));
	};
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
		const [first, last] = [Math.min(...brush), Math.max(...brush)];
		setBrush(null);
		const from = short(low + first * width, 3);
		const to = short(low + (last + 1) * width, 3);
		onQuery(withField(q, column.field, [`${column.field}>=${from}`, `${column.field}<=${to}`]));
	}
	const filtered = range.low !== null || range.high !== null;
	return html`
		<section class="card histogram" aria-label=${column.label}>
			<h2>${column.label}${filtered ? html`<button type="button" class="histogram__clear" onClick=${() => onQuery(withField(q, column.field, []))}>clear</button>` : null}</h2>
			<svg
				viewBox=${`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" role="img"
				aria-label=${`${column.label} from ${short(low, column.digits)} to ${short(high, column.digits)}`}
				onPointerDown=${down} onPointerMove=${move} onPointerUp=${up}
			>
				${counts.map((n, bin) => {
					const tall = n === 0 ? 1 : Math.max(2, (n / most) * HEIGHT);
					return html`<rect key=${bin} data-inside=${inside(bin)} x=${bin * step + 0.8} y=${HEIGHT - tall} width=${step - 1.6} height=${tall} rx="0.8" />`;
				})}
			</svg>
			<p class="histogram__ends"><span>${short(low, column.digits)}</span><span>${short(high, column.digits)}</span></p>
		</section>
	`;
}

/** @param {{q: string, onQuery: (q: string) => void}} props */
export function Histograms({ q, onQuery }) {
	const histograms = summary.value?.histograms ?? {};
	return html`
		${COLUMNS.map((column) => {
			const data = histograms[column.name] ?? { low: 0, high: 1, counts: Array(20).fill(0) };
			return html`<${OneHistogram} key=${column.name} column=${column} data=${data} q=${q} onQuery=${onQuery} />`;
		})}
	`;
}
