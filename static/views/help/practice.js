// @ts-check
/** The practice: how to begin, and what became of each lesson. */

import { html } from 'htm/preact';
import { useEffect } from 'preact/hooks';

import { getPractice } from '../../api/practice.js';
import { count } from '../../lib/format.js';
import { page } from '../../lib/router.js';
import { useResource } from '../../lib/resource.js';
import { isTeam } from '../../state/me.js';
import { isOver, jobToShow } from '../../state/jobs.js';
import { isJudged, making, makingFailed, startPractice } from '../../state/practice.js';
import { JobProgress } from '../job_progress.js';
import { MARKS, WORDS } from '../lesson_card.js';
import { useEnded, useRunningJobs } from '../running_jobs.js';
import { RecordingPracticePart } from './practice_recording.js';

/** @import {LessonJson} from '../../api/practice.js' */

/** @param {{lesson: LessonJson, onLeave: () => void}} props */
function Row({ lesson, onLeave }) {
	const judged = isJudged(lesson);
	return html`
		<tr data-state=${lesson.state}>
			<th scope="row"><a class="link" href=${`/review/${lesson.group}`} onClick=${onLeave}>${lesson.title}</a></th>
			<td class="lesson__state"><span aria-hidden="true">${MARKS[lesson.state]}</span> ${WORDS[lesson.state]}</td>
			<td>${judged ? html`${lesson.feedback} <span class="note">Best: ${lesson.best}</span>` : lesson.question}</td>
		</tr>
	`;
}

/** @param {{onLeave: () => void}} props */
export function PracticePart({ onLeave }) {
	const { value, error, reload } = useResource(getPractice, []);
	const lessons = value?.lessons ?? [];
	const judged = lessons.filter(isJudged);
	const next = lessons.find((lesson) => !isJudged(lesson));
	const right = judged.filter(({ state }) => state === 'right').length;
	const { jobs } = useRunningJobs({ kind: 'practice' }, ({ subject }) => subject?.practice === 'groups');
	const job = making.value ?? jobToShow(jobs.filter((one) => !isOver(one)));
	const busy = job !== null;
	const at = page.value;
	useEnded(jobs, reload);
	useEffect(() => { if (!busy) reload(); }, [busy]);
	/** @param {boolean} again */
	async function begin(again) {
		if (busy) return;
		await startPractice(again);
		// It went to the first group; the help stays only where it could not.
		if (!makingFailed.value && page.value !== at) onLeave();
	}
	return html`
		<div class="practice">
			<p>Eight made-up groups, each with one known fault or none: a wrong name, a missing ball, another moment… You decide as in real work, and a card tells you at once whether it was right and which keys would have been best. It takes about five minutes. The groups are a dataset of their own, <strong>${value?.dataset ?? 'practice'}</strong>: they never mix with ${isTeam ? 'other datasets, and only you and admins see your answers' : 'your data, and can be deleted on the page Datasets'}.</p>
			${error ? html`<p role="alert">The practice could not be read.</p>` : null}
			${judged.length > 0 ? html`<p class="practice__score" role="status"><strong>${count(right)} of ${count(lessons.length)} right</strong>${judged.length < lessons.length ? `, ${count(lessons.length - judged.length)} still to answer` : ''}.</p>` : null}
			<p class="buttons">
				${lessons.length === 0 ? html`<button class="button button--primary" type="button" data-needs="annotate" data-of="" aria-disabled=${busy} onClick=${() => begin(false)}>Make the eight groups and begin</button>`
					: html`
						${next ? html`<a class="button button--primary" href=${`/review/${next.group}`} onClick=${onLeave}>${judged.length ? 'Continue' : 'Begin'} with lesson ${next.number}</a>` : null}
						<button class="button" type="button" data-needs="annotate" data-of="" aria-disabled=${busy} onClick=${() => begin(true)}>Start again</button>`}
			</p>
			${job ? html`<${JobProgress} job=${job} cancellable=${false} />` : null}
			${makingFailed.value ? html`<p class="form__error" role="alert">${makingFailed.value}</p>` : null}
			${lessons.length ? html`
				<table class="table">
					<thead><tr><th scope="col">lesson</th><th scope="col">answer</th><th scope="col">what it is about</th></tr></thead>
					<tbody>${lessons.map((lesson) => html`<${Row} key=${lesson.number} lesson=${lesson} onLeave=${onLeave} />`)}</tbody>
				</table>` : null}
			<${RecordingPracticePart} onLeave=${onLeave} />
		</div>
	`;
}
