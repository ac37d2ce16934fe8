// @ts-check
/** The queue: what to review, in which order, and how far one is. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { count } from '../lib/format.js';
import { useKeys } from '../lib/hooks.js';
import { navigate, param } from '../lib/router.js';
import { dataset, datasets, failure, isPainted, loadDatasets, noiseWords, useDataset } from '../state/datasets.js';
import { queueAddress } from '../state/navigation.js';
import { activeRow, closeQueue, openQueue, queue } from '../state/queue.js';
import { followQueue } from '../state/queue_live.js';
import { resume } from '../state/queue_place.js';
import { NoticeBar } from './bars.js';
import { ExportButton } from './export_dialog.js';
import { FirstSteps } from './first_steps.js';
import { Header } from './header.js';
import { Histograms } from './histograms.js';
import { ProgressCard } from './progress_card.js';
import { QueryBox } from './query_box.js';
import { QueueEmpty } from './queue_empty.js';
import { QueueTable } from './queue_table.js';
import { QueueTools } from './queue_tools.js';

/** Put the query into the address bar; the rest follows from there. @param {string} q */
function setQuery(q) {
	const name = dataset.value?.name ?? '';
	navigate(queueAddress(name, q.trim()), { replace: true });
	letGo();
}

/** Whoever filters with the mouse goes on with the rows: Enter opens one, and does not turn the filter off again. */
function letGo() {
	const held = document.activeElement;
	if (held instanceof HTMLElement && !held.matches(':focus-visible')) held.blur();
}

/** @param {{field: import('preact').RefObject<HTMLInputElement>}} props */
function QueueHeader({ field }) {
	const one = dataset.value;
	const { total, loaded } = queue.value;
	const error = failure.value ?? queue.value.error;
	// Which dataset is meant is known before its rows are: one that is not there has none to wait for.
	const none = datasets.value?.length === 0 && !param('dataset');
	const gone = datasets.value !== null && !one && !none;
	const state = error ? (error.status === 400 ? 'Invalid query' : 'No answer')
		: none ? 'No dataset yet' : gone ? 'No such dataset' : loaded && one ? `${count(total)} of ${count(one.groups)} match` : 'Loading…';
	return html`
		<${Header} current="queue">
			<div class="header__middle">
				<${QueryBox} field=${field} invalid=${queue.value.error?.status === 400} onQuery=${setQuery} />
			</div>
			<span class="save" data-state=${error || gone ? 'failed' : 'saved'} role="status">
				<span class="save__dot" aria-hidden="true"></span>
				${state}
			</span>
			<${ExportButton} />
		<//>
	`;
}

export function QueuePage() {
	const field = useRef(/** @type {HTMLInputElement | null} */ (null));
	const arrived = useRef(false);
	const q = param('q');
	const one = dataset.value;
	useKeys(useRef([
		{ keys: ['/'], label: 'Search', group: 'Queue', run: () => field.current?.select() },
	]).current);
	useEffect(() => {
		document.title = 'Queue · Touchline';
		loadDatasets();
		return closeQueue;
	}, []);
	useEffect(() => {
		if (!one) return;
		useDataset(one.name);
		// Another query begins at its top; who comes from a group goes on at its row.
		if (arrived.current) activeRow.value = 0;
		else resume(one.name, q);
		arrived.current = true;
		openQueue({ id: one.id, name: one.name }, q);
	}, [one?.id, q]);
	useEffect(() => (one ? followQueue(one) : undefined), [one?.id]);
	const { loaded, total, error } = queue.value;
	const nothing = failure.value !== null
		|| (datasets.value !== null && (!one || (loaded && (total === 0 || error !== null))));
	return html`
		<div class="queue">
			<${QueueHeader} field=${field} />
			<div class="bars"><${NoticeBar} />${one ? html`<${FirstSteps} dataset=${one.name} />` : null}</div>
			<main class="queue__main">
				<h1 class="hidden-text">Queue</h1>
				${one ? html`
					<div class="queue__cards" data-painted=${isPainted(one)}><${Histograms} q=${q} painted=${isPainted(one)} noise=${noiseWords(one.policy)} onQuery=${setQuery} /><${ProgressCard} dataset=${one} /></div>
					<${QueueTools} dataset=${one} q=${q} onQuery=${setQuery} />` : null}
				${nothing ? html`<${QueueEmpty} q=${q} />` : html`<${QueueTable} q=${q} painted=${isPainted(one)} onQuery=${setQuery} />`}
			</main>
		</div>
	`;
}
