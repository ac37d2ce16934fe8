// @ts-check
/** How far the server is with solving the groups that one edit of a static camera has changed. */

import { signal } from '@preact/signals';

import { getDatasets } from '../api/client.js';
import { listen } from '../api/events.js';
import { getJobs } from '../api/jobs.js';
import { ApiError } from '../api/problem.js';
import { isOver } from './jobs.js';

/** @import {JobJson} from '../api/jobs.js' */

/** @typedef {{dataset: string, done: number, total: number, sentence: string, over: boolean}} Solving */

const ASK = 800;

/** The work on its way, or the last one that is over; null before any. */
export const solving = signal(/** @type {Solving | null} */ (null));

let turn = 0;

/** Follow the solving of a dataset until it is done. @param {string} dataset */
export async function watchSolving(dataset) {
	const mine = ++turn;
	solving.value = { dataset, done: 0, total: 0, sentence: 'Waiting to be solved…', over: false };
	const stop = listen('job', (/** @type {JobJson} */ job) => {
		if (mine === turn && job.kind === 'solve' && job.dataset === dataset) solving.value = fromJob(dataset, job);
	});
	try {
		while (mine === turn && !solving.value?.over) {
			await new Promise((resolve) => setTimeout(resolve, ASK));
			const told = await ask(dataset);
			if (mine === turn && told) solving.value = told;
		}
	} finally {
		stop();
	}
}

/** @param {string} dataset @param {JobJson} job @returns {Solving} */
function fromJob(dataset, job) {
	return { dataset, done: job.done, total: job.total ?? 0, sentence: job.sentence || job.title, over: isOver(job) };
}

/** The newest solving as the server has it. @param {string} dataset @returns {Promise<Solving | null>} */
async function ask(dataset) {
	try {
		const running = (await getJobs({ dataset, limit: 10 })).items.find((job) => job.kind === 'solve' && !isOver(job));
		return running ? fromJob(dataset, running) : await counted(dataset);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		// The server is away: the work goes on, and so does the question.
		return null;
	}
}

/** Where no job runs, the dataset says how many of its groups are solved. @param {string} dataset @returns {Promise<Solving | null>} */
async function counted(dataset) {
	const found = (await getDatasets()).items.find(({ name }) => name === dataset);
	if (!found) return null;
	const over = found.solved >= found.groups;
	return { dataset, done: found.solved, total: found.groups, sentence: over ? 'Every group is solved.' : 'Solving…', over };
}
