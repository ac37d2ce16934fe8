// @ts-check
/** Jobs as they stand: told by the server, asked for where it cannot tell. */

import { signal as signalOf } from '@preact/signals';

import { connected, listen } from '../api/events.js';
import { getJob, getJobs } from '../api/jobs.js';
import { ApiError } from '../api/problem.js';
import { plural } from '../lib/format.js';

/** @import {JobJson} from '../api/jobs.js' */

const ASK = 700;
const ASK_ALL_THE_SAME = 4000;

/** @param {JobJson} job */
export function isOver(job) {
	return job.state === 'done' || job.state === 'failed' || job.state === 'cancelled';
}

/** How far a job is, 0 to 1; null while nobody knows. @param {JobJson} job */
export function shareOf(job) {
	if (job.state === 'done') return 1;
	return job.total ? Math.min(1, job.done / job.total) : null;
}

/**
 * The one to show of some jobs: that at work, else the one that begins next, else the last that ended.
 *
 * @param {JobJson[]} jobs oldest first @returns {JobJson | null}
 */
export function jobToShow(jobs) {
	return jobs.find(({ state }) => state === 'running') ?? jobs.find((job) => !isOver(job)) ?? jobs.at(-1) ?? null;
}

/** Jobs that wait or run, as far as the person may see them; known while a job that waits is shown. */
export const openJobs = signalOf(/** @type {JobJson[]} */ ([]));
/** Those who show a job that waits, and what ends listening for them. */
let [showing, deafen] = [0, () => {}];

/** Keep `openJobs` up to date until the returned function is called. */
export function followOpenJobs() {
	const read = () => getJobs({ state: 'open', limit: 500 }).then(
		({ items }) => { openJobs.value = items; },
		// It says less while the server cannot be asked.
		(error) => { if (!(error instanceof ApiError)) throw error; },
	);
	if (!showing) {
		read();
		deafen = listen('job', (/** @type {JobJson} */ told) => {
			openJobs.value = [...openJobs.value.filter(({ id }) => id !== told.id), ...(isOver(told) ? [] : [told])];
		}, read);
	}
	showing += 1;
	return () => {
		showing -= 1;
		if (!showing) deafen();
	};
}

/** What a job waits for, in words. @param {JobJson} job @param {JobJson[]} open jobs that wait or run */
export function waitingText(job, open) {
	const before = open.filter(({ id }) => id < job.id);
	const running = before.filter(({ state }) => state === 'running');
	// Jobs of one dataset run one after the other.
	const first = running.find(({ dataset }) => dataset !== null && dataset === job.dataset) ?? running[0];
	return first ? `Waiting for: ${first.title} (${plural(before.length, 'job')} before it)` : 'Waiting.';
}

/**
 * Follow a job to its end.
 *
 * @param {JobJson} job @param {(job: JobJson) => void} seen each time it has moved
 * @param {AbortSignal} [signal]
 * @returns {Promise<JobJson>} the job when it is over
 */
export async function follow(job, seen, signal) {
	let present = job;
	let wake = () => {};
	const stop = listen('job', (/** @type {JobJson} */ told) => {
		if (told.id !== job.id || isOver(present)) return;
		present = told;
		seen(present);
		wake();
	});
	seen(present);
	try {
		while (!isOver(present) && !signal?.aborted) {
			const pause = connected.value ? ASK_ALL_THE_SAME : ASK;
			await new Promise((resolve) => { wake = () => resolve(null); setTimeout(wake, pause); });
			if (isOver(present) || signal?.aborted) break;
			present = await asked(present, signal);
			seen(present);
		}
	} finally {
		stop();
	}
	return present;
}

/** The job as the server knows it; unchanged while it cannot be reached, is busy, or asks to log in again. @param {JobJson} job @param {AbortSignal} [signal] */
async function asked(job, signal) {
	try {
		return await getJob(job.id, signal);
	} catch (error) {
		if (signal?.aborted || (error instanceof ApiError && (error.isPassing || error.status === 401))) return job;
		throw error;
	}
}

/**
 * The result of a request that may have started a job.
 *
 * @param {any} answer a job, or the result itself
 * @param {(job: JobJson) => void} [seen]
 * @returns {Promise<any>}
 */
export async function resultOf(answer, seen = () => {}) {
	if (!answer || typeof answer.kind !== 'string' || typeof answer.state !== 'string') return answer;
	const over = await follow(answer, seen);
	if (over.state === 'done') return over.result;
	throw new Error(over.problem?.detail ?? `The job was ${over.state}.`);
}
