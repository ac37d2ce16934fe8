// @ts-check
/** How far a job is, in one line, with the way to end it. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { cancelJob } from '../api/jobs.js';
import { useAttempt } from '../lib/attempt.js';
import { capital, count } from '../lib/format.js';
import { followOpenJobs, isOver, openJobs, shareOf, waitingText } from '../state/jobs.js';
import { FormError } from './form_error.js';

/** @import {JobJson} from '../api/jobs.js' */

/** @param {JobJson} job @returns {string} */
function jobText(job) {
	if (job.state === 'failed') return capital(job.problem?.detail ?? 'It failed.');
	if (job.sentence) return job.sentence;
	if (job.state === 'waiting') return waitingText(job, openJobs.value);
	return job.total ? `${count(job.done)} of ${count(job.total)}` : '';
}

/**
 * How a job stands, for its colour: an import that left something out is done in part.
 *
 * @param {JobJson} job @returns {string}
 */
export function toneOf(job) {
	return job.state === 'done' && job.result?.outcome === 'partial' ? 'partial' : job.state;
}

/** @param {{job: JobJson}} props */
function Meter({ job }) {
	const share = shareOf(job);
	return html`
		<div
			class="meter" data-state=${job.state} role="progressbar" aria-label=${job.title} aria-valuemin="0" aria-valuemax="100"
			aria-valuenow=${share === null ? undefined : Math.round(100 * share)}
		>${share === null ? null : html`<span style=${{ width: `${100 * share}%` }}></span>`}</div>
	`;
}

/** @param {{job: JobJson, cancellable?: boolean}} props */
export function JobProgress({ job, cancellable = true }) {
	const { error, attempt } = useAttempt();
	const waits = job.state === 'waiting';
	useEffect(() => (waits ? followOpenJobs() : undefined), [waits]);
	const whole = useRef(/** @type {HTMLElement | null} */ (null));
	function cancel() {
		attempt(cancelJob(job.id));
		// The button goes with the job: whoever pressed it by key stays here.
		whole.current?.focus();
	}
	return html`
		<div class="job" role="status" tabindex="-1" ref=${whole}>
			<div class="job__line">
				<span class="pill" data-state=${toneOf(job)}>${toneOf(job) === 'partial' ? 'partly done' : job.state}</span>
				<strong>${job.title}</strong>
				<span class="job__sentence">${jobText(job)}</span>
				${cancellable && !isOver(job) ? html`<button class="button button--small" type="button" data-needs="lead" data-of=${job.dataset ?? ''} onClick=${cancel}>Cancel<span class="hidden-text"> ${job.title}</span></button>` : null}
			</div>
			${isOver(job) ? null : html`<${Meter} job=${job} />`}
			${job.state === 'failed' && job.problem?.hint ? html`<p>${job.problem.hint}</p>` : null}
			${error ? html`<${FormError} error=${error} />` : null}
		</div>
	`;
}
