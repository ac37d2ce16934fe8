// @ts-check
/** The axis below a histogram: its ends, or, where bars are logarithmic, the powers of ten. */

import { html } from 'htm/preact';

/** @typedef {{edges: number[], log: boolean, open_high: boolean}} Bins */

/** What a number needs, for histograms without any: which of it is missing is not known here. */
const NEEDS = /** @type {{[name: string]: string}} */ ({
	jac: 'JaC needs drawn field lines and a camera',
	agreement: 'Agreement needs a camera and the paint of its picture',
	size_ratio: 'A ratio needs a 3D ball and a box drawn around the ball',
});

/** Why no group has a number. @param {string} name */
export function noneOf(name) {
	return NEEDS[name] ? `${NEEDS[name]}; no group here has both.` : 'No group here has this number.';
}

/** Up to four digits, none that says nothing. @param {number} value */
export function short(value) {
	return String(Number(value.toPrecision(4))).replace('-', '−');
}

/** Whether a number is 1 in front of zeros, or behind them. @param {number} value */
function isPowerOfTen(value) {
	return value > 0 && Number.isInteger(Number(Math.log10(value).toFixed(9)));
}

/**
 * Where numbers stand below the bars, as shares of the width. Bars are equally wide on the screen.
 *
 * @param {Bins} bins @returns {{at: number, text: string}[]}
 */
function ticksOf({ edges, log, open_high: beyond }) {
	const last = edges.length - 1;
	const said = (/** @type {number} */ edge) => `${short(edges[edge])}${beyond && edge === last ? '+' : ''}`;
	const shown = edges.flatMap((value, edge) => ((log ? isPowerOfTen(value) : edge === 0 || edge === last) ? [edge] : []));
	return shown.map((edge) => ({ at: edge / last, text: said(edge) }));
}

/** The ends of a bar in words. @param {Bins & {open_low?: boolean}} bins @param {number} bin @param {string} [unit] */
export function endsOf({ edges, log, open_low: below, open_high: beyond }, bin, unit = '') {
	const [from, to] = [short(edges[bin]), short(edges[bin + 1])];
	const of = unit ? ` ${unit}` : '';
	if ((below || log) && bin === 0) return `below ${to}${of}`;
	return beyond && bin === edges.length - 2 ? `${from}${of} and more` : `${from} to ${to}${of}`;
}

/** @param {{bins: Bins}} props */
export function BinAxis({ bins }) {
	return html`
		<p class="bin-axis" data-log=${bins.log} aria-hidden="true">
			${ticksOf(bins).map(({ at, text }) => html`<span key=${text} style=${{ left: `${100 * at}%` }} data-end=${at === 0 ? 'first' : at === 1 ? 'last' : undefined}>${text}</span>`)}
		</p>
	`;
}
