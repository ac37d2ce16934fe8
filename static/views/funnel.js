// @ts-check
/** Where groups are lost, gate by gate. */

import { html } from 'htm/preact';

import { count, plural } from '../lib/format.js';
import { queueAddress } from '../state/navigation.js';
import { gateLabel } from './gate_names.js';
import { isUnmeasured } from './yield_cards.js';

/** @import {FunnelStep, YieldJson} from '../api/policies.js' */

/** What the step asks, with its threshold. @param {FunnelStep} step @param {any} policy */
function labelOf({ gate, label }, policy) {
	const thresholds = /** @type {{[gate: string]: number | null}} */ ({ agreement: policy.min_agreement, parallax: policy.min_parallax_degrees, sigma: policy.max_sigma_m, chi_square: policy.min_p_value });
	const asked = gateLabel(/** @type {any} */ ({ name: gate, threshold: thresholds[gate] ?? null }), policy);
	return asked === gate ? label : asked;
}

/** A gate that had nothing to judge: no bar, for it says nothing about the groups. @param {{step: FunnelStep}} props */
function Unmeasured({ step }) {
	return html`
		<tr data-measured="false">
			<th scope="row">${step.label}</th>
			<td class="funnel__unmeasured" colspan="3">not measured: the cameras were given</td>
		</tr>
	`;
}

/** @param {{step: FunnelStep, all: number, link: string | null}} props */
function Row({ step, all, link }) {
	const dropped = step.dropped ? `−${count(step.dropped)}` : '';
	return html`
		<tr>
			<th scope="row">${step.label}</th>
			<td class="funnel__bar" aria-hidden="true"><span style=${{ width: `${(100 * step.left) / Math.max(1, all)}%` }}></span></td>
			<td data-numeric="true"><strong>${count(step.left)}</strong></td>
			<td data-numeric="true">${link && step.dropped ? html`<a href=${link} title="Show the groups that fail here">${dropped}</a>` : dropped}</td>
		</tr>
	`;
}

/** @param {{answer: YieldJson, dataset: string, linked: boolean}} props `linked`: the queue knows the same gates, for nothing is tried out */
export function Funnel({ answer, dataset, linked }) {
	const unmeasured = isUnmeasured(answer);
	const all = { gate: 'all', label: 'Groups', left: answer.groups, dropped: 0 };
	/** @param {FunnelStep} step */
	const link = ({ gate }) => (linked ? queueAddress(dataset, gate === 'unsolved' ? 'solved:no' : `gate:${gate}`) : null);
	return html`
		<section class="card" aria-labelledby="funnel-title">
			<h2 id="funnel-title">Where groups are lost</h2>
			<table class="funnel">
				<thead class="hidden-text"><tr><th>Gate</th><th>Share</th><th>left</th><th>dropped</th></tr></thead>
				<tbody>
					<${Row} step=${all} all=${answer.groups} link=${null} />
					${answer.funnel.map((step) => {
						const said = { ...step, label: labelOf(step, answer.policy) };
						if (step.gate === 'jac' && unmeasured) return html`<${Unmeasured} key=${step.gate} step=${said} />`;
						return html`<${Row} key=${step.gate} step=${said} all=${answer.groups} link=${link(step)} />`;
					})}
				</tbody>
			</table>
			${answer.given_not_measured && !unmeasured ? html`
				<p class="note">${plural(answer.given_not_measured, 'group')} with given cameras and no field lines: JaC is not measured there, and its gate passes.</p>` : null}
		</section>
	`;
}
