// @ts-check
/** How noisy a dataset's clicks are, what the policy says of it, and the way to make them agree. */

import { html } from 'htm/preact';

import { getNoise } from '../api/noise.js';
import { count } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { Loading, Trouble } from './page_frame.js';

/** @import {ComponentChildren} from 'preact' */
/** @import {AdviceJson, NoiseJson} from '../api/noise.js' */

/**
 * What the estimates change in the policy, for people.
 *
 * @param {NoiseJson} noise @returns {string}
 */
export function changesOf({ advice, values }) {
	const changed = advice.filter(({ name, present }) => name in values && values[name] !== present);
	return changed.map(({ name, label, present }) => `“${label}” to ${values[name].toFixed(2)} (now ${present.toFixed(2)})`).join(', ');
}

/** @param {{item: AdviceJson}} props */
function Row({ item }) {
	return html`
		<tr>
			<th scope="row">${item.label}<small> ${item.unit}</small></th>
			<td data-numeric="true">${item.estimate.toFixed(2)}</td>
			<td data-numeric="true">${item.low.toFixed(2)} to ${item.high.toFixed(2)}</td>
			<td data-numeric="true">${item.present.toFixed(2)}${item.agrees ? '' : ' (differs)'}</td>
		</tr>`;
}

/** @param {{lines: NonNullable<NoiseJson['lines']>}} props */
function Lines({ lines }) {
	return html`
		<tr>
			<th scope="row">Sigma of a point on a line<small> px at 960x540</small></th>
			<td data-numeric="true">${lines.sigma_px.toFixed(2)}</td>
			<td data-numeric="true">${lines.low.toFixed(2)} to ${lines.high.toFixed(2)}</td>
			<td>each image has its own</td>
		</tr>`;
}

/**
 * @param {{dataset: number, version?: string, children?: (noise: NoiseJson) => ComponentChildren}} props
 *   `version` of the policy: another one asks again; `children` draws what can be done about it
 */
export function NoiseCard({ dataset, version = '', children }) {
	const found = useResource((signal) => getNoise(dataset, signal), [dataset, version]);
	const noise = found.value;
	return html`
		<section class="card card--flush" aria-labelledby="noise-title">
			<h2 id="noise-title">Noise of the clicks${noise ? html` <span class="card__aside">from ${count(noise.groups)} of ${count(noise.solved)} solved groups</span>` : null}</h2>
			${found.error ? html`<${Trouble} title="The noise cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${noise ? html`
				<table class="table">
					<thead><tr><th>noise</th><th data-numeric="true">estimate</th><th data-numeric="true">interval</th><th data-numeric="true">policy</th></tr></thead>
					<tbody>
						${noise.advice.map((item) => html`<${Row} key=${item.name} item=${item} />`)}
						${noise.lines ? html`<${Lines} lines=${noise.lines} />` : null}
					</tbody>
				</table>
				${noise.notices.map((sentence) => html`<p class="note" key=${sentence}>${sentence}</p>`)}
				${children?.(noise)}` : found.error ? null : html`<${Loading} what="the noise" />`}
		</section>
	`;
}
