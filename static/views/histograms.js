// @ts-check
/** One histogram for each number; dragging over it, or moving its two ends by keyboard, asks for that range. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { withValue } from '../lib/field.js';
import { plural } from '../lib/format.js';
import { NOISE_ASSUMED } from '../state/datasets.js';
import { rangeOf, withField } from '../state/query.js';
import { queue, summary } from '../state/queue.js';
import { BinAxis, endsOf, noneOf, short } from './bin_axis.js';

/** @import {Histogram} from '../api/types.js' */

const COLUMNS = [
	{ name: 'jac', field: 'jac', label: 'min JaC 0.5 %', title: 'Share of field lines that fit, in the worst view of a group' },
	{ name: 'agreement', field: 'agreement', label: 'paint agrees', title: 'How well camera and paint agree, in the worst view of a group: supported times explained' },
	{ name: 'error_percent', field: 'error_percent', label: 'ball error, %', title: 'Reprojection error of the best pair of views, in per cent of the picture’s diagonal; logarithmic' },
	{ name: 'sigma', field: 'sigma', label: 'σ, m', title: 'Uncertainty of the ball’s position, metres; logarithmic' },
	{ name: 'parallax', field: 'parallax', label: 'parallax, °', title: 'The largest angle between two rays to the ball' },
	{ name: 'size_ratio', field: 'size_ratio', label: 'ball size ÷ expected', title: 'Drawn diameter of the ball over the expected one' },
];
const WIDTH = 200;
const HEIGHT = 44;

/** @typedef {{name: string, field: string, label: string, title: string}} Column */

/** The words of a query that ask for the bins from `first` to `last`, and for nothing beside them. @param {Column} column @param {Histogram} data @param {number} first @param {number} last */
function wordsFor({ field }, { edges, open_high: beyond }, first, last) {
	const from = `${field}>=${edges[first]}`;
	if (last < edges.length - 2) return [from, `${field}<${edges[last + 1]}`];
	return beyond ? [from] : [from, `${field}<=${edges[last + 1]}`];
}

/** The bins that a query asks for, wholly or in part. @param {Column} column @param {Histogram} data @param {string} q @returns {[number, number]} */
function binsOf({ field }, { edges }, q) {
	const { low, high } = rangeOf(q, field);
	const most = edges.length - 2;
	const first = low === null ? 0 : Math.max(0, edges.findLastIndex((edge) => edge <= low));
	const end = high === null ? -1 : edges.findIndex((edge) => edge >= high);
	const last = end < 0 ? most : end - 1;
	return [Math.min(first, most), Math.max(Math.min(first, most), last)];
}

/** The two ends of the range for the keyboard. @param {{column: Column, data: Histogram, bins: [number, number], choose: (first: number, last: number) => void}} props */
function Ends({ column, data, bins, choose }) {
	const most = data.counts.length - 1;
	/** @param {number} at @param {boolean} upper */
	const said = (at, upper) => `${short(data.edges[at + (upper ? 1 : 0)])}${upper && at === most && data.open_high ? ' and more' : ''}`;
	return html`
		<input
			class="histogram__end" type="range" min="0" max=${most} step="1" value=${bins[0]} aria-label=${`${column.label} from`}
			aria-valuetext=${said(bins[0], false)} onChange=${withValue((text) => choose(Math.min(Number(text), bins[1]), bins[1]))}
		/>
		<input
			class="histogram__end" type="range" min="0" max=${most} step="1" value=${bins[1]} aria-label=${`${column.label} to`}
			aria-valuetext=${said(bins[1], true)} onChange=${withValue((text) => choose(bins[0], Math.max(Number(text), bins[0])))}
		/>
	`;
}

/**
 * @param {{column: Column, data: Histogram, q: string, onQuery: (q: string) => void, note: string}} props
 */
function OneHistogram({ column, data, q, onQuery, note }) {
	const [brush, setBrush] = useState(/** @type {[number, number] | null} */ (null));
	const { counts } = data;
	const known = counts.some((n) => n > 0);
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
		<section class="card histogram" aria-label=${column.label} data-known=${known}>
			<h2 title=${column.title}><span class="histogram__label">${column.label}${note ? html` <small title=${NOISE_ASSUMED}>${note}</small>` : null}</span>${filtered ? html`<button type="button" class="histogram__clear" onClick=${() => onQuery(withField(q, column.field, []))}>clear<span class="hidden-text"> ${column.label}</span></button>` : null}</h2>
			<svg
				viewBox=${`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" role="img"
				aria-label=${known ? `${column.label}: ${counts.flatMap((n, bin) => (n ? [`${endsOf(data, bin)}: ${n}`] : [])).join('; ')}` : `${column.label}: no group has this number`}
				onPointerDown=${down} onPointerMove=${move} onPointerUp=${up} onPointerCancel=${() => setBrush(null)}
			>
				${counts.map((n, bin) => {
					const tall = n === 0 ? 1 : Math.max(2, (n / most) * HEIGHT);
					return html`<rect key=${bin} data-inside=${bin >= first && bin <= last} x=${bin * step + 0.8} y=${HEIGHT - tall} width=${step - 1.6} height=${tall} rx="0.8"><title>${endsOf(data, bin)}: ${plural(n, 'group')}</title></rect>`;
				})}
			</svg>
			${known ? html`<${BinAxis} bins=${data} />` : html`<p class="histogram__none">${data.unknown === 0 ? 'No group matches.' : noneOf(column.name)}</p>`}
			<${Ends} column=${column} data=${data} bins=${bins} choose=${choose} />
		</section>
	`;
}

/** @param {{q: string, painted: boolean, noise: string, onQuery: (q: string) => void}} props `painted`: cameras are found from paint; `noise`: what is said beside σ */
export function Histograms({ q, painted, noise, onQuery }) {
	const histograms = summary.value?.histograms ?? {};
	const failed = queue.value.error !== null;
	return html`
		${COLUMNS.filter(({ name }) => painted || name !== 'agreement').map((column) => {
			const data = histograms[column.name];
			if (!data && failed) return html`<section key=${column.name} class="card histogram" aria-label=${column.label} data-known="false"><h2>${column.label}</h2><p class="histogram__none">Not counted: the query fails.</p></section>`;
			return data
				? html`<${OneHistogram} key=${column.name} column=${column} data=${data} q=${q} onQuery=${onQuery} note=${column.name === 'sigma' ? noise : ''} />`
				: html`<section key=${column.name} class="card histogram" aria-busy="true"><h2>${column.label}</h2><svg></svg><p class="bin-axis">–</p></section>`;
		})}
	`;
}
