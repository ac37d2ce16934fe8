// @ts-check
/** The queue follows what happens to its groups elsewhere. */

import { listenToGroups } from '../api/events.js';
import { latest } from '../lib/latest.js';
import { isUnreadable, openQueue, queue } from './queue.js';

/** @import {DatasetJson} from '../api/types.js' */

/** At most one look a second, however much happens. */
const PAUSE = 1000;

/**
 * Keep the rows of a dataset true until the returned function is called.
 *
 * What is in sight is read again as a whole: a group that changes may leave its place, and then
 * those behind it move.
 *
 * @param {DatasetJson} dataset
 * @returns {() => void}
 */
export function followQueue(dataset) {
	const reading = latest(PAUSE, async () => {
		if (!isUnreadable(queue.value.error)) await openQueue(dataset, queue.value.q);
	});
	const stop = listenToGroups((/** @type {{group: number, dataset: string}} */ event) => {
		if (event.dataset === dataset.name) reading.run(event.group);
	}, (name) => {
		if (name === null || name === dataset.name) reading.run(0);
	});
	return () => {
		reading.cancel();
		stop();
	};
}
