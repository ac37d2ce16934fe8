// @ts-check
/** Who decided how much. */

import { html } from 'htm/preact';

import { getReviewers } from '../api/queue.js';
import { ago, count } from '../lib/format.js';
import { useNow } from '../lib/hooks.js';
import { sentenceOf, useResource } from '../lib/resource.js';
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
		${people.value && items.length === 0 ? html`<p class="empty-note">Nobody has decided anything yet.</p>` : null}
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

/** @param {{dataset: DatasetJson, onQuery: (q: string) => void}} props */
export function Reviewers({ dataset, onQuery }) {
	return html`
		<${Popover} id="reviewers" label="Reviewers">
			${(/** @type {() => void} */ close) => html`
				<${People} dataset=${dataset} open=${(/** @type {string} */ q) => { close(); onQuery(q); }} />`}
		<//>
	`;
}
