// @ts-check
/** What else the yield says: curves, splits, distances, matches that leak. */

import { html } from 'htm/preact';
import { useMemo } from 'preact/hooks';

import { count, plural } from '../lib/format.js';
import { queueAddress } from '../state/navigation.js';
import { Chart } from './chart.js';

/** @import {YieldJson} from '../api/policies.js' */

const LOOKS = /** @type {const} */ ([
	{ colour: 'chart-a', dash: [2, 4] }, { colour: 'chart-b', dash: [9, 5] }, { colour: 'chart-c', dash: undefined },
]);

/** Whether nobody measured the JaC of any group: every camera came with the data. @param {YieldJson} answer */
export function isUnmeasured({ given_not_measured: given, groups, unsolved }) {
	return given > 0 && given === groups - unsolved;
}

/** In the place of the curves where there is nothing to draw. */
function Unmeasured() {
	return html`
		<section class="card" aria-labelledby="curves-title">
			<h2 id="curves-title">Groups that qualify, by JaC threshold</h2>
			<p class="yield__unmeasured"><strong>JaC was not measured here: the cameras were given.</strong> It compares a camera with the field lines drawn in its pictures, and this dataset has no lines. So every group passes this gate at any threshold. Draw field lines, or import them, to measure it.</p>
		</section>
	`;
}

/** @param {{answer: YieldJson, marker: number | null}} props */
export function YieldCurves({ answer, marker }) {
	const { curves, given_not_measured: given } = answer;
	const x = curves[0]?.thresholds ?? [];
	// The solid one first: where they coincide, the broken ones are seen on it.
	const drawn = useMemo(() => curves.map(({ gamma_percent: gamma, groups }, index) => ({
		label: `γ = ${gamma} %`, values: groups, ...LOOKS[index % LOOKS.length],
	})).reverse(), [curves]);
	const said = curves.map(({ gamma_percent: gamma, groups }) => `γ ${gamma} %: ${count(groups[0] ?? 0)} to ${count(groups.at(-1) ?? 0)}`).join('; ');
	if (isUnmeasured(answer)) return html`<${Unmeasured} />`;
	return html`
		<section class="card" aria-labelledby="curves-title">
			<h2 id="curves-title">Groups that qualify, by JaC threshold</h2>
			${given ? html`<p class="note">${plural(given, 'group')} without a measured JaC (${given === 1 ? 'its' : 'their'} cameras were given) ${given === 1 ? 'counts' : 'count'} at every threshold.</p>` : null}
			<${Chart}
				name=${`Groups with the ball in two views that qualify, as the JaC threshold grows from 0 to 1. ${said}`}
				xLabel="JaC above" yLabel="groups" x=${x} curves=${drawn} xRange=${[0, 1]} yRange=${[0, null]} marker=${marker} format=${count} height=${330}
			/>
		</section>
	`;
}

/** @param {{from: number | null, to: number | null}} bin */
function binName({ from, to }) {
	if (from === null) return 'no 3D ball';
	return to === null ? `${from} m and more` : `${from} to ${to} m`;
}

/** @param {{answer: YieldJson}} props */
export function Distances({ answer }) {
	const bins = answer.distances;
	const most = Math.max(1, ...bins.map(({ groups }) => groups));
	return html`
		<section class="yield__distances" aria-labelledby="distance-title">
			<h2 id="distance-title">Groups that qualify, by distance from camera to ball</h2>
			<ul class="bar-chart">
				${bins.map((bin) => html`
					<li key=${binName(bin)} title=${`${binName(bin)}: ${count(bin.passing)} of ${count(bin.groups)} pass`}>
						<span data-part="rest" style=${{ height: `${(100 * (bin.groups - bin.passing)) / most}%` }}></span>
						<span style=${{ height: `${(100 * bin.passing) / most}%` }}></span>
						<b class="hidden-text">${binName(bin)}: ${count(bin.passing)} of ${count(bin.groups)} pass</b>
					</li>`)}
			</ul>
			<p class="bar-chart__ends" aria-hidden="true"><span>${bins[0] ? binName(bins[0]) : ''}</span><span>${bins.length ? binName(bins[bins.length - 1]) : ''}</span></p>
		</section>
	`;
}

/** @param {{answer: YieldJson, dataset: string}} props */
export function Splits({ answer, dataset }) {
	return html`
		<section class="card card--flush" aria-labelledby="splits-title">
			<h2 id="splits-title">Splits</h2>
			<table class="table">
				<thead><tr><th>split</th><th data-numeric="true">groups</th><th data-numeric="true">pass</th><th data-numeric="true">share</th></tr></thead>
				<tbody>${answer.splits.map(({ split, groups, passing }) => html`
					<tr key=${split}>
						<th scope="row">${split ? html`<a href=${queueAddress(dataset, `split:${split}`)}>${split}</a>` : 'none'}</th>
						<td data-numeric="true">${count(groups)}</td><td data-numeric="true">${count(passing)}</td>
						<td data-numeric="true">${groups ? `${((100 * passing) / groups).toFixed(1)} %` : '–'}</td>
					</tr>`)}
				</tbody>
			</table>
			<${Leakage} answer=${answer} dataset=${dataset} />
		</section>
	`;
}

/** @param {any} splits names, or names with their counts @returns {string} */
function splitsText(splits) {
	if (!Array.isArray(splits)) return Object.entries(splits).map(([name, n]) => `${name} ${n}`).join(', ');
	return splits.map((one) => (typeof one === 'string' ? one : `${one.split} ${one.groups}`)).join(', ');
}

/** @param {{answer: YieldJson, dataset: string}} props */
function Leakage({ answer, dataset }) {
	if (answer.leakage.length === 0) return html`<p class="yield__note">No match lies in two splits.</p>`;
	return html`
		<div class="yield__note" role="status">
			<p data-grade="warn">${count(answer.leakage.length)} ${answer.leakage.length === 1 ? 'match lies' : 'matches lie'} in more than one split:</p>
			<ul>${answer.leakage.slice(0, 8).map(({ match, splits }) => html`
				<li key=${match}><a class="link" href=${queueAddress(dataset, `match:"${match}"`)}>${match}</a> (${splitsText(splits)})</li>`)}
			</ul>
		</div>
	`;
}
