// @ts-check
/** The lesson of a practice group: what to look for, a hint, and whether the last answer was right. */

import { html } from 'htm/preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';

import { getPractice } from '../api/practice.js';
import { useKeys } from '../lib/hooks.js';
import { useResource } from '../lib/resource.js';
import { isJudged } from '../state/practice.js';
import { waiting } from '../state/sending.js';
import { openHelpAt } from '../state/workspace.js';

/** @import {LessonJson} from '../api/practice.js' */
/** @import {GroupDocument} from '../api/types.js' */

/** Glyphs beside the colours. */
export const MARKS = { open: '○', mended: '○', right: '✓', almost: '≈', wrong: '✗' };
export const WORDS = { open: 'not answered yet', mended: 'fixed', right: 'right', almost: 'nearly right', wrong: 'look again' };

/** @param {{lesson: LessonJson, of?: string}} props */
function Feedback({ lesson, of = '' }) {
	return html`
		<div class="lesson__feedback" data-state=${lesson.state} role="status">
			<p>${of ? html`<strong>${of} </strong>` : null}${lesson.feedback}</p>
			${lesson.best ? html`<p class="lesson__best">Best: ${lesson.best}</p>` : null}
		</div>
	`;
}

/** @param {{lessons: LessonJson[], current: number}} props */
function Dots({ lessons, current }) {
	return html`
		<ol class="lesson__dots" aria-label="Lessons">
			${lessons.map((lesson) => html`
				<li key=${lesson.number} data-state=${lesson.state} aria-current=${lesson.number === current ? 'step' : undefined}>
					<span aria-hidden="true">${MARKS[lesson.state]}</span><span class="hidden-text">${lesson.number}: ${WORDS[lesson.state]}</span>
				</li>`)}
		</ol>
	`;
}

/** The group on screen and the one before it; the card itself may be away between the two. */
let seen = { now: /** @type {number | null} */ (null), before: /** @type {number | null} */ (null) };

/** The group that was on screen before this one; null for the first. @param {number} id @returns {number | null} */
function groupBefore(id) {
	if (seen.now !== id) seen = { now: id, before: seen.now };
	return seen.before;
}

/** @param {{group: GroupDocument}} props */
export function LessonCard({ group }) {
	const before = groupBefore(group.id);
	// An answer counts once the server has it.
	const busy = waiting.value.some((item) => item.group === before || item.group === group.id);
	const { value } = useResource(async (signal) => (busy ? null : (await getPractice(signal)).lessons), [group.id, group.etag, busy]);
	const kept = useRef(/** @type {LessonJson[]} */ ([]));
	if (value) kept.current = value;
	const [hinted, setHinted] = useState(0);
	useEffect(() => setHinted(0), [group.id]);
	useKeys(useMemo(() => [{
		keys: ['Shift+h'], label: 'Hint for this practice group', group: 'Practice', run: () => setHinted(group.id),
	}], [group.id]));
	const lessons = kept.current;
	const lesson = lessons.find((one) => one.group === group.id);
	if (!lesson) return null;
	const last = lessons.find((one) => one.group === before && isJudged(one));
	const judged = lessons.filter(isJudged);
	const right = judged.filter(({ state }) => state === 'right').length;
	return html`
		<section class="card lesson" aria-label="Practice">
			<h2>${lesson.title}<${Dots} lessons=${lessons} current=${lesson.number} /></h2>
			${last ? html`<${Feedback} key=${last.number} lesson=${last} of=${`Lesson ${last.number}.`} />` : null}
			${lesson.feedback ? html`<${Feedback} key="here" lesson=${lesson} />` : null}
			${isJudged(lesson) ? null : html`
				<p class="lesson__question">${lesson.question}</p>
				${hinted === group.id ? html`<p class="lesson__hint" role="status"><strong>Hint:</strong> ${lesson.hint}</p>`
					: html`<button class="link-button" type="button" onClick=${() => setHinted(group.id)}>Show a hint <kbd>Shift H</kbd></button>`}`}
			${judged.length === lessons.length ? html`
				<p class="lesson__end"><strong>All ${lessons.length} are answered: ${right} right.</strong>${' '}<button class="link-button" type="button" onClick=${() => openHelpAt('practice')}>See the results</button></p>` : null}
		</section>
	`;
}
