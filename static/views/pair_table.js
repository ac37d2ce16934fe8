// @ts-check
/** Every pair of views: the ball of the two, and why the pair counts or not. */

import { html } from 'htm/preact';

import { diagonal } from '../geometry/preview.js';
import { degrees, fixed, pixels, words } from '../lib/format.js';
import { Letter } from './letter.js';
import { Term } from './term.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */

/** @typedef {SolutionJson['pairs'][number]} PairSolution */

/**
 * Why a pair does not count, in words.
 *
 * @param {GroupDocument} group @param {PairSolution} pair
 */
export function whyNot(group, { a, b, errors_px: errors, failed }) {
	if (failed !== 'reprojection') return words(failed ?? 'not valid');
	const off = [a, b].some((key, i) => {
		const view = group.views.find((one) => one.key === key);
		return !view || errors[i] > (group.policy.tau_percent / 100) * diagonal(view);
	});
	return off ? 'reprojection' : 'the rays meet behind a camera';
}

/** @param {{group: GroupDocument, solution: SolutionJson}} props */
export function PairTable({ group, solution }) {
	if (solution.pairs.length === 0) return null;
	/** @param {string} key */
	const letter = (key) => group.views.find((view) => view.key === key)?.letter ?? '?';
	return html`
		<section class="card" aria-label="Pairs in numbers">
			<h2>Pairs</h2>
			<table class="numbers numbers--pairs">
				<thead>
					<tr>
						<th scope="col">pair</th>
						<th scope="col"><${Term} word="parallax">β<//></th>
						<th scope="col"><${Term} word="column:pair_baseline">base m<//></th>
						<th scope="col"><${Term} word="column:pair_errors">errors px<//></th>
						<th scope="col"><span class="hidden-text">valid</span></th>
					</tr>
				</thead>
				<tbody>
					${solution.pairs.map((pair) => html`
						<tr key=${`${pair.a} ${pair.b}`} data-valid=${pair.valid}>
							<th scope="row"><span class="pair-letters"><${Letter} letter=${letter(pair.a)} /><${Letter} letter=${letter(pair.b)} /></span></th>
							<td>${degrees(pair.parallax_degrees)}</td>
							<td>${fixed(pair.baseline_m, 1)}</td>
							<td data-number="pair-errors">${pixels(pair.errors_px[0])} · ${pixels(pair.errors_px[1])}</td>
							<td class="pair-state" data-grade=${pair.valid ? 'ok' : 'bad'} title=${pair.valid ? 'valid' : whyNot(group, pair)}>
								<span aria-hidden="true">${pair.valid ? '✓' : '✗'}</span>
								<span class="hidden-text">${pair.valid ? 'valid' : whyNot(group, pair)}</span>
							</td>
						</tr>
					`)}
				</tbody>
			</table>
		</section>
	`;
}
