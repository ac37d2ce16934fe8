// @ts-check
/** Verdicts on many groups, and taking them back. */

import { ApiError } from '../api/problem.js';
import { undoVerdicts } from '../api/queue.js';
import { count, plural } from '../lib/format.js';
import { page } from '../lib/router.js';
import { dataset, loadDatasets } from './datasets.js';
import { document, open } from './group.js';
import { did, forget } from './last_action.js';
import { complain, inform } from './notice.js';
import { openQueue, queue } from './queue.js';

/** @import {BulkResult} from '../api/queue.js' */
/** @import {BatchDone} from './last_action.js' */

/** Say what a bulk verdict did, and offer to take it back. @param {BulkResult} result @param {string} state */
export function tellBatch({ batch, changed, refused }, state) {
	const left = refused.reduce((sum, { groups }) => sum + groups, 0);
	const text = batchText(changed, state);
	const rest = left ? ` ${count(left)} ${left === 1 ? 'stays as it was' : 'stay as they were'}.` : '';
	if (batch === null) {
		inform(`${text}.${rest}`);
		return;
	}
	/** @type {BatchDone} */
	const action = { kind: 'batch', batch, text };
	did(action);
	inform(`${text}.${rest}`, { label: 'Undo', run: () => takeBatchBack(action) });
}

/** Give every group of a batch the verdict back that it had before. @param {BatchDone} action */
export async function takeBatchBack(action) {
	try {
		const { restored, kept } = await undoVerdicts(action.batch);
		forget(action);
		const rest = kept ? ` ${plural(kept, 'group')} ${kept === 1 ? 'was' : 'were'} judged since and ${kept === 1 ? 'stays' : 'stay'}.` : '';
		inform(`${count(restored)} ${restored === 1 ? 'verdict is' : 'verdicts are'} taken back.${rest}`);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		// Somebody else may have taken it back, or it is gone with its dataset.
		if (error.status === 409 || error.status === 404) forget(action);
		complain(`Not taken back: ${error.message}`);
	}
	await readAgain();
}

/** What is on screen, as it is now. */
export async function readAgain() {
	loadDatasets();
	const one = dataset.value;
	if (page.value.page === 'queue' && one) await openQueue(one, queue.value.q);
	else if (document.value) await open(document.value.id);
}

/** What a batch says: "3 groups deferred". @param {number} changed @param {string} state */
export function batchText(changed, state) {
	return `${plural(changed, 'group')} ${state === 'unreviewed' ? 'withdrawn' : state}`;
}
