// @ts-check
/** How noisy a dataset's clicks are, what the policy says of it, and the way to make them agree. */

import { html } from 'htm/preact';

import { getNoise } from '../api/match_estimates.js';
import { count } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { Loading, Trouble } from './page_frame.js';

/** @import {ComponentChildren} from 'preact' */
/** @import {AdviceJson, FactorJson, NoiseJson, SourceNoiseJson} from '../api/match_estimates.js' */

/**
 * What the estimates change in the policy, for people.
 *
 * @param {NoiseJson} noise @returns {string}
 */
export function changesOf({ advice, values }) {
	const changed = advice.filter(({ name, present }) => name in values && values[name] !== present);
	return changed.map(({ name, label, present }) => `“${label}” to ${values[name].toFixed(2)} (now ${shownPresent(present)})`).join(', ');
}

/** Whether judging by the estimates would change anything. @param {NoiseJson} noise */
export function isNews({ values, is_new }) {
	return is_new || Object.keys(values).length > 0;
}

/** Whether a number of the policy contradicts the estimates; one that it leaves to each image does not. @param {NoiseJson} noise */
export function isContradicted({ advice, is_new }) {
	return is_new || advice.some(({ present, agrees }) => present !== null && !agrees);
}

/**
 * Who has a sigma of their own, for people.
 *
 * @param {FactorJson[]} factors @returns {string}
 */
function unlike(factors) {
	const own = factors.filter(({ camera, person, ratio }) => ratio !== 1 && (camera === null || person === null));
	const names = own.map(({ camera, person, ratio }) => `${camera === null ? person : `camera ${camera}`} (${ratio.toFixed(2)} times)`);
	if (names.length) return names.join(', ');
	return factors.some(({ ratio }) => ratio !== 1) ? 'some combinations of camera and person' : '';
}

/** @param {number | null} value @returns {string} what the policy says */
function shownPresent(value) {
	return value === null ? 'estimated per image' : value.toFixed(2);
}

/** @param {{item: AdviceJson}} props */
function Row({ item }) {
	return html`
		<tr>
			<th scope="row">${item.label}<small> ${item.unit}</small></th>
			<td data-numeric="true">${item.estimate.toFixed(2)}</td>
			<td data-numeric="true">${item.low.toFixed(2)} to ${item.high.toFixed(2)}</td>
			<td data-numeric="true">${shownPresent(item.present)}${item.agrees || item.present === null ? '' : ' (differs)'}</td>
		</tr>`;
}

/** @param {{of: string, one: SourceNoiseJson}} props */
function SourceRow({ of, one }) {
	return html`
		<tr>
			<th scope="row">Balls ${of} ${one.source}<small> px at 1920x1080</small></th>
			<td data-numeric="true">${one.sigma_px.toFixed(2)}</td>
			<td data-numeric="true">${one.low.toFixed(2)} to ${one.high.toFixed(2)}</td>
			<td data-numeric="true">${one.differs ? 'differs from the dataset' : 'same as the dataset'}</td>
		</tr>`;
}

/** What sigma makes of cameras and people. @param {{noise: NoiseJson}} props */
function Own({ noise }) {
	const { factors = [], used = [], stations = [], people = [] } = noise;
	if (!stations.length && !people.length && !used.length) return null;
	const [now, shown] = [unlike(used), unlike(factors)];
	return html`
		<p class="note">${now ? `The sigma of a ball is computed with separate noise for ${now}.` : 'The sigma of every ball is computed with the same noise.'}
			${noise.is_new ? (shown ? ` The estimates differ from the dataset for ${shown}.` : ' The estimates show no differences.') : ''}</p>`;
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
			<h2 id="noise-title">Annotation noise${noise ? html` <span class="card__aside">from ${count(noise.groups)} of ${count(noise.solved)} solved groups</span>` : null}</h2>
			${found.error ? html`<${Trouble} title="The noise cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${noise ? html`
				<table class="table noise">
					<thead><tr><th>noise of</th><th data-numeric="true">estimate</th><th data-numeric="true">interval</th><th data-numeric="true">policy</th></tr></thead>
					<tbody>
						${noise.advice.map((item) => html`<${Row} key=${item.name} item=${item} />`)}
						${noise.stations?.map((one) => html`<${SourceRow} key=${`camera ${one.source}`} of="of camera" one=${one} />`)}
						${noise.people?.map((one) => html`<${SourceRow} key=${`person ${one.source}`} of="placed by" one=${one} />`)}
					</tbody>
				</table>
				<${Own} noise=${noise} />
				${noise.notices.map((sentence) => html`<p class="note" key=${sentence}>${sentence}</p>`)}
				${children?.(noise)}` : found.error ? null : html`<${Loading} what="the noise" />`}
		</section>
	`;
}
