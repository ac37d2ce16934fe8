// @ts-check
/** Work that outlasts a request: what runs, what is done, what failed. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { getJobs } from '../api/jobs.js';
import { connected, listen } from '../api/events.js';
import { ApiError } from '../api/problem.js';
import { plural } from '../lib/format.js';
import { isOver } from '../state/jobs.js';
import { pageAddress } from './dataset_menu.js';
import { JobProgress, toneOf } from './job_progress.js';
import { mayImport } from './no_datasets.js';
import { Empty, Loading, PageFrame, Trouble } from './page_frame.js';
import { When } from './when.js';

/** @import {JobJson} from '../api/jobs.js' */

const PAGE = 50;
const ASK = 1500;

/**
 * What the newest knowledge of each job is, the newest job first. A job that is over stays so: a
 * list that was asked for before its end may arrive after the news of it.
 *
 * @param {JobJson[]} jobs @param {JobJson[]} more
 */
function merged(jobs, more) {
	const byId = new Map(jobs.map((job) => [job.id, job]));
	for (const job of more) {
		const before = byId.get(job.id);
		if (!before || isOver(job) || !isOver(before)) byId.set(job.id, job);
	}
	return [...byId.values()].sort((a, b) => b.id - a.id);
}

/** Jobs, followed. */
function useJobs() {
	const [jobs, setJobs] = useState(/** @type {JobJson[] | null} */ (null));
	const [next, setNext] = useState(/** @type {string | null} */ (null));
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	/** Where the next page begins; undefined where nothing could be read. @param {string | null} cursor */
	async function read(cursor) {
		try {
			const found = await getJobs({ limit: PAGE, cursor });
			setJobs((before) => merged(before ?? [], found.items));
			setError(null);
			return found.next;
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			setError(problem);
			return undefined;
		}
	}
	const first = () => read(null).then((cursor) => setNext((before) => before ?? cursor ?? null));
	useEffect(() => {
		first();
		return listen('job', (/** @type {JobJson} */ job) => setJobs((before) => merged(before ?? [], [job])), () => { read(null); });
	}, []);
	// Where the server cannot tell, ask; once it can, ask for what it told before anybody listened.
	useEffect(() => {
		if (connected.value) {
			read(null);
			return undefined;
		}
		const timer = setInterval(() => { if (!document.hidden) read(null); }, ASK);
		return () => clearInterval(timer);
	}, [connected.value]);
	return { jobs, next, error, retry: first, more: () => read(next).then((cursor) => setNext((before) => (cursor === undefined ? before : cursor))) };
}

/** What an import did not bring, in numbers. @param {JobJson} job */
function partOf(job) {
	if (toneOf(job) !== 'partial') return null;
	const { new: fresh = 0, changed = 0, unchanged = 0, skipped = [], more_skipped: more = 0, without_picture: blind = 0 } = job.result;
	const left = skipped.length + more;
	const parts = [
		plural(fresh + changed + unchanged, 'group'), left ? `${plural(left, 'record')} left out` : '', blind ? `${plural(blind, 'group')} without any picture` : '',
	].filter(Boolean);
	return html`<p data-grade="warn">${parts.join(' · ')}</p>`;
}

/** @param {{job: JobJson}} props */
function JobCard({ job }) {
	return html`
		<li>
			<section class="card" aria-label=${`Job ${job.id}: ${job.title}`}>
				<${JobProgress} job=${job} />
				<p class="note">${job.kind}${job.dataset ? html` · <a class="link" href=${pageAddress(job.dataset, 'queue')}>${job.dataset}</a>` : null}${` · ${job.actor} · ${job.started ? 'started' : 'requested'} `}<${When} at=${job.started ?? job.created} />${job.ended ? html`${' · ended '}<${When} at=${job.ended} />` : null}</p>
				${partOf(job)}
			</section>
		</li>
	`;
}

/** @param {{title: string, jobs: JobJson[]}} props */
function JobList({ title, jobs }) {
	return html`
		<section aria-label=${title}>
			<div class="page__title"><h2>${title}</h2></div>
			<ul class="page__list">${jobs.map((job) => html`<${JobCard} key=${job.id} job=${job} />`)}</ul>
		</section>
	`;
}

export function JobsPage() {
	const { jobs, next, error, retry, more } = useJobs();
	const open = (jobs ?? []).filter((job) => !isOver(job));
	const over = (jobs ?? []).filter(isOver);
	return html`
		<${PageFrame} current="jobs" title="Jobs" where=${html`<strong>Jobs</strong>`}>
			${error ? html`<${Trouble} title="The jobs cannot be shown" error=${error} retry=${retry} />` : null}
			${!jobs && !error ? html`<${Loading} what="jobs" />` : null}
			${jobs?.length === 0 ? html`<${Empty} what="jobs" title="No jobs yet"><p>Imports, solving, freezing, exports and evaluations show up here.</p>${mayImport() ? html`<p><a class="button" href="/import">Import a dataset</a></p>` : null}<//>` : null}
			${open.length ? html`<${JobList} title="Under way" jobs=${open} />` : null}
			${over.length ? html`<${JobList} title="Finished" jobs=${over} />` : null}
			${next ? html`<p><button class="button" type="button" onClick=${more}>Older jobs</button></p>` : null}
		<//>
	`;
}
