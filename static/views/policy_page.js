// @ts-check
/** The policy as text: read, downloaded, replaced; and every one that came before. */

import { html } from 'htm/preact';
import { useRef, useState } from 'preact/hooks';

import { acceptNoise, revertNoise } from '../api/match_estimates.js';
import { getPolicies, getPolicy, putPolicy, putPolicyText } from '../api/policies.js';
import { withValue } from '../lib/field.js';
import { saveText } from '../lib/save_text.js';
import { useResource } from '../lib/resource.js';
import { loadDatasets } from '../state/datasets.js';
import { pageAddress } from './dataset_menu.js';
import { DatasetFrame } from './dataset_frame.js';
import { JobButton } from './job_button.js';
import { JobProgress } from './job_progress.js';
import { changesOf, isNews, NoiseCard } from './noise_card.js';
import { Loading, Trouble } from './page_frame.js';
import { useSavePolicy } from './save_policy.js';
import { When } from './when.js';

/** @import {JobJson} from '../api/jobs.js' */
/** @import {NoiseJson} from '../api/match_estimates.js' */
/** @import {PolicyField, PolicyState, ShippedPolicy} from '../api/policies.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** @typedef {(put: () => Promise<JobJson>) => Promise<boolean>} Send */

/** @param {{one: DatasetJson, policy: PolicyState, etag: string, busy: boolean, send: Send}} props */
function PolicyText({ one, policy, etag, busy, send }) {
	const [text, setText] = useState(policy.yaml);
	const changed = text !== policy.yaml;
	const why = busy ? 'Under way' : changed ? '' : 'The text is unchanged';
	/** @param {Event} event */
	async function pick(event) {
		const field = /** @type {HTMLInputElement} */ (event.target);
		const file = field.files?.[0];
		if (file) setText(await file.text());
		field.value = '';
	}
	/** @param {SubmitEvent} event */
	async function submit(event) {
		event.preventDefault();
		if (!why) await send(() => putPolicyText(one.id, text, etag));
	}
	return html`
		<section class="card" aria-labelledby="text-title">
			<h2 id="text-title">As YAML, the same in the browser and on the command line</h2>
			<form class="form" onSubmit=${submit}>
				<textarea
					class="field policy__text" aria-label="Policy as YAML" spellcheck=${false} wrap="off" rows="26" value=${text}
					onInput=${withValue(setText)}
				></textarea>
				<p class="buttons">
					<button data-needs="lead" class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>Save and solve</button>
					<button class="button" type="button" aria-disabled=${!changed} title=${changed ? '' : why} onClick=${() => setText(policy.yaml)}>Reset</button>
					<button class="button" type="button" onClick=${() => saveText(`${one.name}-policy.yaml`, policy.yaml)}>Download</button>
					<label class="button">Open a file…<input class="hidden-text" type="file" accept=".yaml,.yml,text/yaml" onChange=${pick} /></label>
				</p>
			</form>
		</section>
	`;
}

/** @param {{one: DatasetJson, policy: PolicyState, etag: string, shipped: ShippedPolicy[], busy: boolean, send: Send}} props */
function Shipped({ one, policy, etag, shipped, busy, send }) {
	return html`
		<section class="card card--flush" aria-labelledby="shipped-title">
			<h2 id="shipped-title">Policies that come with Touchline</h2>
			<table class="table">
				<tbody>${shipped.map(({ name, hash }) => html`
					<tr key=${name}>
						<th scope="row">${name}</th>
						<td><span class="table__actions">
							${hash === policy.hash || (name === policy.name && policy.values.noise === 'estimated') ? html`<span class="note">in force</span>` : html`
								<${JobButton} busy=${busy} act=${() => send(() => putPolicy(one.id, name, null, etag))} kind="button--small">Use ${name}<//>`}
						</span></td>
					</tr>`)}
				</tbody>
			</table>
		</section>
	`;
}

/** @param {{one: DatasetJson, policy: PolicyState, busy: boolean, send: Send}} props */
function NoiseOf({ one, policy, busy, send }) {
	const version = useRef(''), sent = useRef(0);
	// While groups are solved the answer would be of no use a moment later.
	if (!busy || !version.current) version.current = `${policy.hash} ${policy.version} ${sent.current}`;
	/** @param {() => Promise<JobJson>} put */
	function act(put) {
		sent.current += 1;
		send(put);
	}
	return html`
		<${NoiseCard} dataset=${one.id} version=${version.current}>
			${(/** @type {NoiseJson} */ noise) => (!isNews(noise) && !noise.used?.length ? null : html`
				${changesOf(noise) ? html`<p class="note">The button sets ${changesOf(noise)}.</p>` : null}
				<p class="buttons">
					${isNews(noise) ? html`<${JobButton} busy=${busy} act=${() => act(() => acceptNoise(one.id))}>Use the estimates and solve<//>` : null}
					${noise.used?.length ? html`<${JobButton} busy=${busy} act=${() => act(() => revertNoise(one.id))}>Use one noise for all balls<//>` : null}
				</p>`)}
		<//>
	`;
}

/** @param {{policy: PolicyState}} props */
function History({ policy }) {
	return html`
		<section class="card card--flush" aria-labelledby="history-title">
			<h2 id="history-title">History</h2>
			<table class="table">
				<thead><tr><th>version</th><th>name</th><th>hash</th><th>since</th><th>by</th></tr></thead>
				<tbody>${policy.history.toReversed().map(({ version, name, hash, at, actor }) => html`
					<tr key=${version}>
						<td>${version}</td><th scope="row">${name}</th><td class="mono">${hash.slice(0, 12)}</td>
						<td><${When} at=${at} /></td><td>${actor}</td>
					</tr>`)}
				</tbody>
			</table>
		</section>
	`;
}

/** @param {unknown} value */
function valueText(value) {
	if (typeof value === 'boolean') return value ? 'yes' : 'no';
	return String(value);
}

/** @param {{policy: PolicyState, fields: PolicyField[]}} props */
function ValueTable({ policy, fields }) {
	return html`
		<section class="card card--flush" aria-labelledby="values-title">
			<h2 id="values-title">${policy.name}, version ${policy.version} <span class="card__aside mono">${policy.hash}</span></h2>
			<table class="table">
				<tbody>${fields.map(({ name, label, unit }) => {
					const value = policy.values[name];
					return html`<tr key=${name}><th scope="row">${label}</th><td data-numeric="true">${value === null || value === undefined ? 'not set' : `${valueText(value)} ${unit === 'share' ? '' : unit ?? ''}`}</td></tr>`;
				})}
				</tbody>
			</table>
		</section>
	`;
}

/** @param {{one: DatasetJson}} props */
function PolicyOf({ one }) {
	const loaded = useResource(async (signal) => {
		const [{ items, fields }, { policy, etag }] = await Promise.all([getPolicies(signal), getPolicy(one.id, signal)]);
		return { shipped: items, fields, policy, etag };
	}, [one.id]);
	const { job, error, send, ...saving } = useSavePolicy(() => { loaded.reload(); loadDatasets(); });
	// What was saved is in force only once it was read: until then the policy that stands here is an old one.
	const busy = saving.busy || loaded.waiting;
	if (loaded.error) return html`<${Trouble} title="The policy could not be loaded" error=${loaded.error} retry=${loaded.reload} />`;
	if (!loaded.value) return html`<${Loading} what="the policy" />`;
	const { shipped, fields, policy, etag } = loaded.value;
	return html`
		${job ? html`<section class="card"><${JobProgress} job=${job} /></section>` : null}
		${error ? html`<p class="card form__error" role="alert">${error}</p>` : null}
		<div class="page__columns policy">
			<${PolicyText} key=${`${policy.hash} ${policy.version}`} one=${one} policy=${policy} etag=${etag} busy=${busy} send=${send} />
			<div class="page__list">
				<${Shipped} one=${one} policy=${policy} etag=${etag} shipped=${shipped} busy=${busy} send=${send} />
				<${NoiseOf} one=${one} policy=${policy} busy=${busy} send=${send} />
				<${ValueTable} policy=${policy} fields=${fields} />
				<${History} policy=${policy} />
			</div>
		</div>
	`;
}

export function PolicyPage() {
	return html`
		<${DatasetFrame} current="policy" title="Policy">
			${(/** @type {DatasetJson} */ one) => html`
				<p class="note">Try thresholds out on the <a class="link" href=${pageAddress(one.name, 'yield')}>yield page</a>.</p>
				<${PolicyOf} key=${one.id} one=${one} />`}
		<//>
	`;
}
