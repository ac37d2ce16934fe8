// @ts-check
/** Verdicts on many groups, taking them back, and giving them again. */

import { ApiError } from '../api/problem.js';
import { redoVerdicts, undoVerdicts } from '../api/queue.js';
import { count, plural, words } from '../lib/format.js';
import { page } from '../lib/router.js';
import { dataset, loadDatasets } from './datasets.js';
import { groupDocument, open } from './group.js';
import { did, didAgain, forget, forgetUndone, tookBack, undone } from './last_action.js';
import { complain, inform } from './notice.js';
import { openQueue, queue } from './queue.js';

/** @import {BulkResult} from '../api/queue.js' */
/** @import {BatchDone} from './last_action.js' */

/** Why a bulk verdict leaves groups alone: one, and several. */
const REFUSALS = /** @type {{[reason: string]: [string, string]}} */ ({
	submitted: ['it is a submitted independent annotation', 'they are submitted independent annotations'],
	undecided: ['its independent annotations differ, and nobody has decided yet', 'their independent annotations differ, and nobody has decided yet'],
	unsolved: ['it is not solved yet', 'they are not solved yet'],
	needs_note: ['it fails a gate, and accepting that needs a note', 'they fail a gate, and accepting that needs a note'],
	unusable_ball: [
		'its 3D ball is unusable (below the grass, or uncertain by metres), and accepting that needs a note',
		'their 3D balls are unusable (below the grass, or uncertain by metres), and accepting that needs a note',
	],
	no_picture: ['none of its views has a picture, and accepting that needs a note', 'none of their views has a picture, and accepting that needs a note'],
});

/** @param {string} reason @param {number} groups how many */
export function whyUnchanged(reason, groups) {
	return REFUSALS[reason]?.[groups === 1 ? 0 : 1] ?? words(reason);
}

/** Say what a bulk verdict did, and offer to take it back. @param {BulkResult} result @param {string} state @param {string} dataset */
export function announceBatch({ batch, changed, refused }, state, dataset) {
	const text = batchText(changed, state);
	const rest = refused.map(({ reason, groups }) => ` ${count(groups)} ${groups === 1 ? 'is' : 'are'} unchanged: ${whyUnchanged(reason, groups)}.`).join('');
	if (batch === null) {
		inform(`${text}.${rest}`);
		return;
	}
	/** @type {BatchDone} */
	const action = { kind: 'batch', dataset, batch, text };
	did(action);
	inform(`${text}.${rest}`, { label: 'Undo', run: () => undoBatch(action) });
}

/** Give every group of a batch the verdict back that it had before. @param {BatchDone} action */
export async function undoBatch(action) {
	try {
		const { restored, kept } = await undoVerdicts(action.batch);
		forget(action);
		if (restored > 0) tookBack(action);
		const text = `${count(restored)} ${restored === 1 ? 'verdict is' : 'verdicts are'} undone.${stayed(kept, 'reviewed since')}`;
		inform(text, restored > 0 ? { label: 'Redo', run: () => redoBatch(action) } : undefined);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		// Somebody else may have taken it back, or it is gone with its dataset.
		if (error.status === 409 || error.status === 404) forget(action);
		complain(`Not undone: ${error.message}`);
	}
	await readAgain();
}

/** Give the verdicts of a batch again that was taken back. @param {BatchDone} action */
export async function redoBatch(action) {
	try {
		const { batch, changed, kept, refused } = await redoVerdicts(action.batch);
		const failing = refused.reduce((sum, { groups }) => sum + groups, 0);
		const rest = stayed(kept, 'reviewed or edited since') + stayed(failing, 'no longer eligible');
		if (batch === null) {
			forgetUndone(action);
			inform(`No verdict was redone.${rest}`);
		} else {
			/** @type {BatchDone} */
			const again = { kind: 'batch', dataset: action.dataset, batch, text: action.text.replace(/^[\d,]+ groups?/, plural(changed, 'group')) };
			if (undone.value.some((other) => other.kind === 'batch' && other.batch === action.batch)) {
				forgetUndone(action);
				undone.value = [...undone.value, action];
				didAgain(action, again);
			} else did(again);
			inform(`${again.text} again.${rest}`, { label: 'Undo', run: () => undoBatch(again) });
		}
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		if (error.status === 409 || error.status === 404) forgetUndone(action);
		complain(`Not redone: ${error.message}`);
	}
	await readAgain();
}

/** Groups that stay as they are, as a sentence; '' for none. @param {number} groups @param {string} why */
function stayed(groups, why) {
	if (groups === 0) return '';
	return ` ${plural(groups, 'group')} ${groups === 1 ? 'was' : 'were'} ${why} and ${groups === 1 ? 'is unchanged' : 'are unchanged'}.`;
}

/** What is on screen, as it is now. */
export async function readAgain() {
	loadDatasets();
	const one = dataset.value;
	if (page.value.page === 'queue' && one) await openQueue(one, queue.value.q);
	else if (groupDocument.value) await open(groupDocument.value.id);
}

/** What a batch says: "3 groups deferred". @param {number} changed @param {string} state */
export function batchText(changed, state) {
	return `${plural(changed, 'group')} ${state === 'unreviewed' ? 'withdrawn' : state}`;
}
