// @ts-check
/** Who decided how much, and what was decided for many groups at once. */

import { html } from 'htm/preact';

import { sentenceOf } from '../api/problem.js';
import { getBatches, getReviewers } from '../api/queue.js';
import { ago, count } from '../lib/format.js';
import { useNow } from '../lib/hooks.js';
import { useResource } from '../lib/resource.js';
import { batchText, redoBatch, undoBatch } from '../state/queue_batches.js';
import { Popover } from './popover.js';

/** @import {DatasetJson} from '../api/types.js' */

/** @param {{dataset: DatasetJson, open: (q: string) => void}} props */
function People({ dataset, open }) {
	const now = useNow(10_000);
	const people = useResource((signal) => getReviewers(dataset.id, signal), [dataset.id]);
	const items = people.value?.items ?? [];
	return html`
		<h2>Reviewers of ${dataset.name}</h2>
		${people.error ? html`<p class="form__error" role="alert">${sentenceOf(people.error)}</p>` : null}
		${people.value && items.length === 0 ? html`<p class="empty-note">No verdicts yet.</p>` : null}
		${items.length > 0 ? html`
			<table class="table">
				<thead><tr>
					<th>Person</th><th data-numeric="true">accepted</th><th data-numeric="true">rejected</th>
					<th data-numeric="true">deferred</th><th data-numeric="true">today</th><th>last</th>
				</tr></thead>
				<tbody>${items.map((person) => html`
					<tr key=${person.name}>
						<th scope="row"><button class="link-button" type="button" onClick=${() => open(`reviewer:"${person.name}"`)}>${person.name}</button></th>
						<td data-numeric="true">${count(person.accepted)}</td>
						<td data-numeric="true">${count(person.rejected)}</td>
						<td data-numeric="true">${count(person.deferred)}</td>
						<td data-numeric="true">${count(person.today)}</td>
						<td>${person.last ? ago(Date.parse(person.last), now) : '–'}</td>
					</tr>`)}
				</tbody>
			</table>` : null}
	`;
}

/** The newest verdicts on many groups, each to be taken back as a whole, and given again. @param {{dataset: DatasetJson}} props */
function Batches({ dataset }) {
	const now = useNow(10_000);
	const batches = useResource((signal) => getBatches(dataset.id, signal), [dataset.id]);
	const items = batches.value?.items ?? [];
	/** @param {typeof items[number]} batch */
	async function undo({ id, changed, state }) {
		await undoBatch({ kind: 'batch', dataset: dataset.name, batch: id, text: batchText(changed, state) });
		batches.reload();
	}
	/** @param {typeof items[number]} batch */
	async function redo({ id, changed, state }) {
		await redoBatch({ kind: 'batch', dataset: dataset.name, batch: id, text: batchText(changed, state) });
		batches.reload();
	}
	if (items.length === 0) return null;
	return html`
		<section class="batches">
			<h2>Bulk verdicts</h2>
			<ul>
				${items.map((batch) => html`
					<li key=${batch.id}>
						<span>
							${batchText(batch.changed, batch.state)}
							<small>${batch.actor} · ${ago(Date.parse(batch.at), now)}${batch.undone ? ` · undone by ${batch.undone_by}` : ''}${batch.redone ? ' · redone' : ''}</small>
						</span>
						${batch.undone ? null : html`<button data-needs="review" class="button" type="button" onClick=${() => undo(batch)}>Undo</button>`}
						${batch.undone && !batch.redone ? html`<button data-needs="review" class="button" type="button" title="Give these verdicts again, except to groups reviewed or edited since the undo" onClick=${() => redo(batch)}>Redo</button>` : null}
					</li>`)}
			</ul>
		</section>
	`;
}

/** @param {{dataset: DatasetJson, onQuery: (q: string) => void}} props */
export function Reviewers({ dataset, onQuery }) {
	return html`
		<${Popover} id="reviewers" label="Reviewers">
			${(/** @type {() => void} */ close) => html`
				<${People} dataset=${dataset} open=${(/** @type {string} */ q) => { close(); onQuery(q); }} />
				<${Batches} dataset=${dataset} />`}
		<//>
	`;
}
