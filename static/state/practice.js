// @ts-check
/** The practice: eight groups with known answers, and whether somebody was told of it. */

import { computed, effect, signal } from '@preact/signals';

import { postPractice } from '../api/practice.js';
import { ApiError } from '../api/problem.js';
import { navigate, place } from '../lib/router.js';
import { stored } from '../lib/storage.js';
import { loadDatasets } from './datasets.js';
import { follow } from './jobs.js';
import { actions } from './last_action.js';
import { loadSession, isTeam } from './me.js';
import { inform } from './notice.js';

/** @import {JobJson} from '../api/jobs.js' */

/** Whether the first steps were offered and taken, or waved away. */
const offered = stored('first-steps', 'new');
export const offerFirstSteps = computed(() => offered.value === 'new');

/** The job that makes the practice groups; null when none does. */
export const making = signal(/** @type {JobJson | null} */ (null));
/** Why they could not be made, or "". */
export const makingFailed = signal('');

/** Do not offer the first steps again. */
export function endFirstSteps() {
	offered.value = 'done';
}

// Whoever judges a group has made the first step already.
effect(() => {
	if (actions.value.some(({ kind }) => kind !== 'edit')) endFirstSteps();
});

/** Make the practice groups where they are missing, and open the first one. @param {boolean} [again] */
export async function startPractice(again = false) {
	if (making.value) return;
	makingFailed.value = '';
	const from = place.peek();
	try {
		const job = await follow(await postPractice(again), (moved) => { making.value = moved; });
		if (job.state === 'done') {
			endFirstSteps();
			// A team's server has made a dataset in which one may judge, whatever one may elsewhere.
			if (isTeam) await Promise.all([loadSession(), loadDatasets()]);
			const open = () => navigate(`/review/${job.result.first}`);
			// Who went elsewhere meanwhile is not called away from there.
			if (place.peek() === from) open();
			else inform('Your practice groups are ready.', { label: 'Open them', run: open });
		} else makingFailed.value = job.problem?.detail ?? `The job was ${job.state}.`;
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		makingFailed.value = error.message;
	} finally {
		making.value = null;
	}
}

/** @param {import('../api/practice.js').LessonJson} lesson */
export function isJudged({ state }) {
	return state !== 'open' && state !== 'mended';
}
