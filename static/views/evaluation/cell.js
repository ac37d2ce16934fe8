// @ts-check
/** A number with its interval and its denominator. */

import { html } from 'htm/preact';

import { count, fixed } from '../../lib/format.js';

/** @import {CellJson} from '../../api/evaluations.js' */

/** Digits that a number of that size needs. @param {number | null} value */
function digitsOf(value) {
	const size = Math.abs(value ?? 0);
	return size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
}

/** @param {number | null} value */
export function number(value) {
	return fixed(value, digitsOf(value));
}

/** @param {{cell: CellJson | null}} props */
export function Cell({ cell }) {
	if (!cell) return html`–`;
	const { value, low, high, count: n, of } = cell;
	return html`
		<span class="cell">
			<strong>${number(value)}</strong>
			${low !== null && high !== null ? html`<small title="95 % interval">${number(low)} to ${number(high)}</small>` : null}
			<small title="frames used for this number, of all frames">${count(n)} of ${count(of)}</small>
		</span>
	`;
}
