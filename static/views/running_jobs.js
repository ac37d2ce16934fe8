// @ts-check
/** The jobs that work on what a page shows, whoever began them and whenever. */

import { useEffect, useRef, useState } from 'preact/hooks';

import { listen } from '../api/events.js';
import { getJobs } from '../api/jobs.js';
import { ApiError } from '../api/problem.js';
import { follow, isOver } from '../state/jobs.js';

/** @import {JobJson} from '../api/jobs.js' */

/**
 * @typedef {object} RunningJobs
 * @property {JobJson[]} jobs those that wait or run, and those that ended while the page was open; oldest first
 * @property {(begun: JobJson) => Promise<JobJson>} watch one that was begun here; resolves when it is over
 */

/**
 * Follow the jobs that work on what a page shows.
 *
 * @param {{dataset?: string, kind?: string}} where to look for those that were begun before the page was opened
 * @param {(job: JobJson) => boolean} concerns whether a job works on what is shown
 * @returns {RunningJobs}
 */
export function useRunningJobs({ dataset, kind }, concerns) {
	const [jobs, setJobs] = useState(/** @type {JobJson[]} */ ([]));
	const latest = useRef(concerns);
	latest.current = concerns;
	const leaving = useRef(new AbortController());
	const endings = useRef(/** @type {Map<number, Promise<JobJson>>} */ (new Map()));
	/** @param {JobJson} moved */
	const show = (moved) => setJobs((before) => [...before.filter(({ id }) => id !== moved.id), moved].sort((a, b) => a.id - b.id));
	/** @param {JobJson} begun */
	function watch(begun) {
		const { signal } = leaving.current;
		const there = endings.current.get(begun.id);
		if (there) return there;
		const ending = follow(begun, (moved) => { if (!signal.aborted) show(moved); }, signal);
		endings.current.set(begun.id, ending);
		// One that was refused says nothing of the next.
		ending.catch(() => { if (endings.current.get(begun.id) === ending) endings.current.delete(begun.id); });
		return ending;
	}
	useEffect(() => {
		const leave = new AbortController();
		leaving.current = leave;
		/** @param {JobJson} found */
		const take = (found) => {
			if (!latest.current(found)) return;
			// It may be gone with its dataset.
			watch(found).catch((error) => { if (!(error instanceof ApiError)) throw error; });
		};
		const find = () => getJobs({ dataset, kind, state: 'open', limit: 100 }, leave.signal).then(
			({ items }) => { for (const found of items) take(found); },
			// What the page shows is worth more than what else is at work.
			(error) => { if (!leave.signal.aborted && !(error instanceof ApiError)) throw error; },
		);
		find();
		const deaf = listen('job', take, find);
		return () => {
			deaf();
			leave.abort();
			endings.current.clear();
			setJobs([]);
		};
	}, [dataset, kind]);
	return { jobs, watch };
}

/** Do something each time one of some jobs is over. @param {JobJson[]} jobs @param {() => void} act */
export function useEnded(jobs, act) {
	const over = jobs.filter(isOver).length;
	useEffect(() => { if (over) act(); }, [over]);
}
