// @ts-check
/** Where groups are lost, gate by gate. */

import { html } from 'htm/preact';

import { count } from '../lib/format.js';
import { queueAddress } from '../state/navigation.js';
import { gateLabel } from './gate_names.js';

/** @import {FunnelStep, YieldJson} from '../api/policies.js' */

/** What the step asks, with its threshold. @param {FunnelStep} step @param {any} policy */
function labelOf({ gate, label }, policy) {
	const thresholds = /** @type {{[gate: string]: number | null}} */ ({ parallax: policy.min_parallax_degrees, sigma: policy.max_sigma_m });
	const asked = gateLabel(/** @type {any} */ ({ name: gate, threshold: thresholds[gate] ?? null }), policy);
	return asked === gate ? label : asked;
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
	const steps = answer.funnel;
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
					${steps.filter(({ gate }) => gate !== 'all').map((step) => html`<${Row} key=${step.gate} step=${{ ...step, label: labelOf(step, answer.policy) }} all=${answer.groups} link=${link(step)} />`)}
				</tbody>
			</table>
			${answer.given_not_measured ? html`
				<p class="note">${count(answer.given_not_measured)} groups have given cameras without lines: their JaC is not measured.</p>` : null}
		</section>
	`;
}
