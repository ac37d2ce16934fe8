// @ts-check
/** The times of a replay from the ball: where it is in both shots, and how far its rays miss each other under the map. */

import { html } from 'htm/preact';
import { useRef } from 'preact/hooks';

import { getCameraStretches, turnCameras } from '../../api/cameras.js';
import { postUpload } from '../../api/imports.js';
import { postBallLink } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { isOver, jobToShow } from '../../state/jobs.js';
import { Chart } from '../chart.js';
import { FormError } from '../form_error.js';
import { JobProgress } from '../job_progress.js';
import { useEnded, useRunningJobs } from '../running_jobs.js';

/** @import {JobSubject} from '../../api/jobs.js' */
/** @import {LinkedShot, LinkJson} from '../../api/recordings.js' */

/** A file of a form as an upload; null: none was chosen. @param {FormDataEntryValue | null} file */
async function sent(file) {
	return file instanceof File && file.name ? (await postUpload(file, () => {})).id : null;
}

/** Whether a job works on frames of a replay. @param {LinkedShot} replay @param {JobSubject | null} subject */
function isOfReplay({ recording, first, last }, subject) {
	return subject?.recording === recording && (subject.first ?? 0) <= last && first <= (subject.last ?? Infinity);
}

/** @param {{link: LinkJson, dataset: string, reload: () => void}} props */
export function BallCard({ link, dataset, reload }) {
	const { jobs, watch } = useRunningJobs({ dataset }, ({ kind, subject }) => (kind === 'link' ? subject?.link === link.id : kind === 'track' && isOfReplay(link.replay, subject)));
	const job = jobToShow(jobs);
	useEnded(jobs, reload);
	const { error, busy, attempt } = useAttempt();
	const form = useRef(/** @type {HTMLFormElement | null} */ (null));
	const runs = busy || (job !== null && !isOver(job));
	function look() {
		if (!form.current) return;
		const said = new FormData(form.current);
		const files = Promise.all([sent(said.get('live')), sent(said.get('replay'))]);
		attempt(files.then(([live, replay]) => postBallLink(link.live.recording, link.id, { live_upload: live, replay_upload: replay })), watch);
	}
	const { misses, turned } = link.map;
	/** Turn the cameras of the replay, and look for the times once more. */
	async function turn() {
		if (runs) return;
		const { recording, first } = link.replay;
		const turning = getCameraStretches(recording).then(async ({ items }) => {
			const stretch = items.find((one) => one.first <= first && first <= one.last);
			if (stretch) watch(await turnCameras(recording, stretch.first, !stretch.summary.turned));
		});
		// It waits for the turn on the server: whoever leaves the page meanwhile finds the times.
		if (await attempt(turning)) look();
	}
	return html`
		<section class="card linking__ball" aria-label="Ball">
			<h2>Ball</h2>
			<p>Rays of the ball meet where both frames show the same instant. Both shots need tracked cameras, and the ball: marked in groups that were taken from them, or in a file <code>ball.csv</code> (<code>frame,time_s,x,y</code>).</p>
			${turned ? html`
				<p role="status">The replay was tracked from the wrong side of the pitch: its rays meet the live ones once its cameras are turned to the other side.
					<button class="button button--small" type="button" data-needs="lead" data-of=${dataset} aria-disabled=${runs} onClick=${turn}>Turn the replay’s cameras</button></p>` : null}
			<form class="linking__files" ref=${form} onSubmit=${(/** @type {SubmitEvent} */ event) => { event.preventDefault(); if (!runs) look(); }}>
				<label>ball.csv of the live recording <input type="file" name="live" accept=".csv" /></label>
				<label>ball.csv of the replay’s recording <input type="file" name="replay" accept=".csv" /></label>
				<button class="button" type="submit" data-needs="lead" data-of=${dataset} aria-disabled=${runs} title=${runs ? 'The search is running' : ''}>Find the times from the ball</button>
			</form>
			${error ? html`<${FormError} error=${error} />` : null}
			${job ? html`<${JobProgress} job=${job} />` : null}
			${misses.length ? html`
				<${Chart}
					name="Distance between the ray of the replay and that of the live shot, by frame of the replay" xLabel="frame of the replay" yLabel="distance, m" height=${150}
					x=${misses.map(({ frame }) => frame)} curves=${[{ label: 'distance between the rays', values: misses.map(({ miss_m: miss }) => miss), colour: 'chart-a', points: true }]}
					yRange=${[0, null]} format=${(/** @type {number} */ value) => `${value.toFixed(2)} m`}
				/>` : null}
		</section>
	`;
}
