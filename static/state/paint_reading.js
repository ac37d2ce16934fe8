// @ts-check
/** Reading the pictures of a group's match again; loaded when somebody asks for it. */

import { readDatasetPaint } from '../api/paint.js';
import { sentenceOf } from '../api/problem.js';
import { follow } from './jobs.js';
import { announce, complain } from './notice.js';

/** @import {GroupDocument} from '../api/types.js' */

/** Have the pictures of the match read: those that still fit are only compared. @param {GroupDocument} shown */
export async function readAgain({ dataset, match }) {
	try {
		announce('The pictures of this match are read.');
		const job = await follow(await readDatasetPaint(dataset.id, match), () => {});
		if (job.state === 'failed') complain(job.problem?.detail ?? 'The pictures could not be read.');
	} catch (error) {
		complain(sentenceOf(error));
	}
}
