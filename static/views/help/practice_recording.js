// @ts-check
/** The practice on a recording: a film with known faults, and what is right of it by now. */

import { html } from 'htm/preact';

import { getRecordingPractice, postRecordingPractice } from '../../api/practice.js';
import { useAttempt } from '../../lib/attempt.js';
import { useResource } from '../../lib/resource.js';
import { loadDatasets } from '../../state/datasets.js';
import { isOver, jobToShow } from '../../state/jobs.js';
import { loadSession, isTeam } from '../../state/me.js';
import { FormError } from '../form_error.js';
import { JobProgress } from '../job_progress.js';
import { MARKS, WORDS } from '../lesson_card.js';
import { useEnded, useRunningJobs } from '../running_jobs.js';

const NAMES = { shots: 'Shots', cameras: 'Cameras', side: 'Side', link: 'Replay' };

/** @param {{onLeave: () => void}} props */
export function RecordingPracticePart({ onLeave }) {
	const { value, error, reload } = useResource(getRecordingPractice, []);
	const { jobs, watch } = useRunningJobs({ kind: 'practice' }, ({ subject }) => subject?.practice === 'recording');
	const job = jobToShow(jobs);
	useEnded(jobs, reload);
	const { error: refused, attempt } = useAttempt();
	const busy = job !== null && !isOver(job);
	const lessons = value?.lessons ?? [];
	const next = lessons.find(({ state }) => state !== 'right');
	/** @param {boolean} again */
	function begin(again) {
		if (busy) return;
		attempt(postRecordingPractice(again), async (begun) => {
			const over = await watch(begun);
			if (over.state === 'done' && isTeam) await Promise.all([loadSession(), loadDatasets()]);
		});
	}
	/** @param {number} frame */
	const place = (frame) => `/recordings/${value?.recording}?frame=${frame}`;
	return html`
		<section class="practice" aria-labelledby="practice-recording">
			<h3 id="practice-recording">With a recording</h3>
			<p>A made-up film of 23 seconds with four known faults: a missing cut, a shot of the wrong kind, a lost camera, and a replay that is tracked from the wrong side and not linked. Correct them as in real work; this page shows what is right so far. Allow ten minutes, and a minute to draw the film.</p>
			${error ? html`<p role="alert">The practice on a recording could not be read.</p>` : null}
			<p class="buttons">
				${lessons.length === 0 ? html`<button class="button" type="button" data-needs="annotate" data-of="" aria-disabled=${busy} onClick=${() => begin(false)}>Make the recording</button>`
					: html`
						${next ? html`<a class="button" href=${place(next.frame)} onClick=${onLeave}>Go to: ${NAMES[next.name].toLowerCase()}</a>` : null}
						<button class="button" type="button" onClick=${reload}>Check again</button>`}
				${value?.recording ? html`<button class="button" type="button" data-needs="annotate" data-of="" aria-disabled=${busy} onClick=${() => begin(true)}>Restart the practice</button>` : null}
			</p>
			${job && job.state !== 'done' ? html`<${JobProgress} job=${job} />` : null}
			${refused ? html`<${FormError} error=${refused} />` : null}
			${lessons.length ? html`
				<table class="table">
					<thead><tr><th scope="col">lesson</th><th scope="col">state</th><th scope="col">what is right</th><th scope="col">what to do</th></tr></thead>
					<tbody>${lessons.map((lesson) => html`
						<tr key=${lesson.name} data-state=${lesson.state}>
							<th scope="row"><a class="link" href=${place(lesson.frame)} onClick=${onLeave}>${NAMES[lesson.name]}</a></th>
							<td class="lesson__state"><span aria-hidden="true">${MARKS[lesson.state]}</span> ${WORDS[lesson.state]}</td>
							<td>${lesson.feedback}</td>
							<td>${lesson.question} <span class="note">${lesson.hint}</span></td>
						</tr>`)}</tbody>
				</table>` : null}
		</section>
	`;
}
