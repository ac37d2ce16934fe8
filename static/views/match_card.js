// @ts-check
/** What cards with a row for each match share: their frame; they follow changes, and send theirs. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { listenToGroups } from '../api/events.js';
import { getJobs } from '../api/jobs.js';
import { latest } from '../lib/latest.js';
import { useResource } from '../lib/resource.js';
import { datasets } from '../state/datasets.js';
import { JobButton } from './job_button.js';
import { JobProgress } from './job_progress.js';
import { useSavePolicy } from './save_policy.js';

/** @import {ComponentChildren, Ref} from 'preact' */
/** @import {JobJson} from '../api/jobs.js' */

/** What somebody else changed is shown after this many milliseconds at the latest. */
const PAUSE = 3000;

/**
 * @template T
 * @param {(dataset: number, signal: AbortSignal) => Promise<T>} get reads what the card shows
 * @param {number} dataset
 * @param {readonly string[]} concerned kinds of changes of groups after which it is read again
 * @param {string} [job] kind of its jobs: one that was begun before, or elsewhere, is followed too
 */
export function useMatchCard(get, dataset, concerned, job) {
	const { value, error, reload } = useResource((signal) => get(dataset, signal), [dataset]);
	useEffect(() => {
		const reading = latest(PAUSE, async () => reload());
		/** @param {string | null} changed null: any */
		const isMine = (changed) => changed === null || changed === datasets.value?.find(({ id }) => id === dataset)?.name;
		const stop = listenToGroups(
			(/** @type {{kind: string, dataset: string}} */ told) => { if (concerned.includes(told.kind) && isMine(told.dataset)) reading.run(null); },
			(changed) => { if (isMine(changed)) reading.run(null); },
		);
		return () => { stop(); reading.cancel(); };
	}, [reload, dataset]);
	const card = useRef(/** @type {HTMLElement | null} */ (null));
	// The button that was pressed goes: whoever is still here, or nowhere, goes on from the heading.
	const saving = useSavePolicy(() => {
		const at = document.activeElement;
		if (!at || at === document.body || card.current?.contains(at)) card.current?.querySelector('h2')?.focus();
		reload();
	});
	useEffect(() => {
		if (!job) return undefined;
		const controller = new AbortController();
		getJobs({ dataset: String(dataset), kind: job, state: 'open', limit: 1 }, controller.signal).then(({ items: [running] }) => {
			if (running && !controller.signal.aborted) saving.send(async () => running);
		}, () => {});
		return () => controller.abort();
	}, [dataset, job]);
	return { value, error, reload, card, saving };
}

/** The first cell of a match's row. @param {{name: string, aside: string}} props as `matchName` has them */
export function MatchHead({ name, aside }) {
	return html`<th scope="row">${name}${aside ? html`<small>${aside}</small>` : null}</th>`;
}

/**
 * A button in a match's row.
 *
 * @param {{name: string, busy: boolean, act: () => void, title: string, kind?: string, children: ComponentChildren}} props
 *   name: of the match, for whoever hears the button alone
 */
export function MatchButton({ name, kind = '', children, ...rest }) {
	return html`<${JobButton} ...${rest} kind=${`button--small ${kind}`}>${children}<span class="hidden-text"> for ${name}</span><//>`;
}

/**
 * @param {{
 *   id: string, title: ComponentChildren, columns: string[], rows: ComponentChildren, note?: ComponentChildren,
 *   card: Ref<HTMLElement>, job: JobJson | null, refused: string
 * }} props columns: those between the match and what can be done; job: what is under way; refused: why not
 */
export function MatchCard({ id, title, columns, rows, note = null, card, job, refused }) {
	return html`
		<section class="card card--flush statistics__matches" aria-labelledby=${`${id}-title`} ref=${card}>
			<h2 id=${`${id}-title`} tabindex="-1">${title}</h2>
			<table class="table">
				<thead><tr><th>match</th>${columns.map((name) => html`<th key=${name}>${name}</th>`)}<th><span class="hidden-text">actions</span></th></tr></thead>
				<tbody>${rows}</tbody>
			</table>
			${note}
			${job ? html`<${JobProgress} job=${job} />` : null}
			${refused ? html`<p class="form__error" role="alert">${refused}</p>` : null}
		</section>
	`;
}
