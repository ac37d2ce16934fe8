// @ts-check
/** When there is nothing to list: why, and what to do about it. */

import { html } from 'htm/preact';

import { capital } from '../lib/format.js';
import { param } from '../lib/router.js';
import { dataset, datasets, failure, loadDatasets } from '../state/datasets.js';
import { queueAddress } from '../state/navigation.js';
import { wordsOf } from '../state/query.js';
import { isUnreadable, openQueue, queue } from '../state/queue.js';
import { NoDatasets, mayImport } from './no_datasets.js';

/** What is told to people from whom groups are hidden: that it is so and why, neither which nor how many. */
export const HIDDEN_WHY = 'While you annotate a batch of this dataset independently, some of its groups are hidden from you. Lists and counts do not include them until the batch is closed.';

/** The query with the word that cannot be read marked. @param {{q: string, pointer: string | null}} props */
function Marked({ q, pointer }) {
	const place = /^\/q\/(\d+)$/.exec(pointer ?? '');
	if (!place) return null;
	// Positions count characters, not halves of them.
	const letters = [...q];
	const [before, rest] = [letters.slice(0, Number(place[1])).join(''), letters.slice(Number(place[1])).join('')];
	const [first = ''] = wordsOf(rest);
	// A quote that is not closed begins no word.
	const word = first && rest.startsWith(first) ? first : rest;
	return html`<p><code>${before}<mark>${word}</mark>${rest.slice(word.length)}</code></p>`;
}

/** Read what could not be read, the list of datasets too: the dataset may be gone. @param {string} q */
function readAgain(q) {
	loadDatasets();
	if (dataset.value) openQueue(dataset.value, q);
}

/** @param {{q: string}} props */
export function QueueEmpty({ q }) {
	const error = failure.value ?? queue.value.error;
	const name = dataset.value?.name ?? '';
	if (error) {
		return html`
			<section class="card empty" role="alert">
				<h2>${isUnreadable(error) ? 'The query cannot be read' : 'The queue cannot be shown'}</h2>
				<${Marked} q=${q} pointer=${error.pointer} />
				<p>${capital(error.message)}.</p>
				${error.hint ? html`<p>${error.hint}</p>` : null}
				<p>${failure.value || !isUnreadable(error)
					? html`<button class="button" type="button" onClick=${() => readAgain(q)}>Try again</button>`
					: html`<a class="button" href=${queueAddress(name, '')}>Show all groups</a>`}</p>
			</section>
		`;
	}
	if (datasets.value?.length === 0) {
		return html`<${NoDatasets} />`;
	}
	if (!dataset.value) {
		return html`
			<section class="card empty">
				<h2>There is no dataset “${param('dataset')}”</h2>
				${mayImport() ? html`<p>It may have been deleted, or its import may have failed; see the list of jobs. Open another dataset, or import the files again.</p>`
					: html`<p>It may have been deleted, or you have no role in it: ask a lead or an admin for one. You can open another dataset.</p>`}
				<p class="buttons"><a class="button button--primary" href="/datasets">All datasets</a>${mayImport() ? html`<a class="button" href=${`/import?dataset=${encodeURIComponent(param('dataset'))}`}>Import</a>` : null}<a class="button" href="/jobs">Jobs</a></p>
			</section>
		`;
	}
	if (dataset.value.hides_groups && !q) {
		return html`
			<section class="card empty">
				<h2>No groups to show: they are hidden from you</h2>
				<p>${HIDDEN_WHY}</p>
				<p><a class="button button--primary" href="/work">My work</a></p>
			</section>
		`;
	}
	return html`
		<section class="card empty">
			<h2>${q ? 'No group matches this query' : 'This dataset has no groups'}</h2>
			${q ? html`<p>Remove a filter, or show all groups.${dataset.value.hides_groups ? ` ${HIDDEN_WHY}` : ''}</p><p><a class="button" href=${queueAddress(name, '')}>Show all groups</a></p>`
				: html`<p>Nothing was imported into it yet.</p>${mayImport(name) ? html`<p><a class="button button--primary" href=${`/import?dataset=${encodeURIComponent(name)}`}>Import</a></p>` : html`<p>A lead of this dataset can import files.</p>`}`}
		</section>
	`;
}
