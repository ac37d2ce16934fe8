// @ts-check
/** Arriving at a group: what the address bar names is on screen in the same moment. */

import { effect, signal, untracked } from '@preact/signals';

import { ApiError } from '../api/problem.js';
import { navigate, page } from '../lib/router.js';
import { dataset, failure, loadDatasets } from './datasets.js';
import { groupDocument, open } from './group.js';
import { currentId, firstGroup, lastGroup, locate, query, reviewAddress } from './navigation.js';
import { complain, dismiss, notice } from './notice.js';
import { resetForGroup } from './workspace.js';

/** The group that was asked for and cannot be shown; 0 while there is none. */
export const absent = signal(0);

/** Whether it may be shown later: the server was away, or nobody was logged in. */
export const mayReturn = signal(false);

/** Answers after which the same question may be answered: no network, no session, too many requests, no database. */
const PASSING = [0, 401, 429, 503];

/** What was said of the group that cannot be shown. @type {import('./notice.js').Notice | null} */
let said = null;

/** @param {number} id */
async function enter(id) {
	absent.value = 0;
	try {
		await Promise.all([open(id), locate(id)]);
		if (said && notice.value === said) dismiss();
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		const passes = PASSING.includes(error.status);
		// While the server is away what is known stays on screen; the save state says so.
		if (currentId() !== id || (passes && groupDocument.value?.id === id)) return;
		if (error.status === 404) lastGroup.value = 0;
		absent.value = id;
		mayReturn.value = passes;
		complain(`Group ${id} cannot be shown: ${error.message}`, passes
			? { label: 'Try again', run: retry }
			: { label: 'Open the queue', run: () => navigate('/groups') });
		said = notice.value;
	}
}

/** Ask again for the group that could not be shown, if there is one that may return. */
export function retry() {
	if (absent.value && mayReturn.value && currentId() === absent.value) enter(absent.value);
}

/** Without a number: the first group of the queue. */
async function enterFirst() {
	await loadDatasets();
	if (failure.value) {
		navigate('/groups', { replace: true });
		return;
	}
	const first = dataset.value ? await firstGroup(dataset.value.name) : null;
	navigate(first === null ? '/groups' : reviewAddress(first), { replace: true });
}

/** A verdict may take the group on screen out of its queue, and undo brings it back. */
function followVerdict() {
	let said = { id: 0, state: '' };
	effect(() => {
		const at = groupDocument.value;
		const now = { id: at?.id ?? 0, state: at?.verdict.state ?? '' };
		const turned = now.id === said.id && now.state !== said.state;
		said = now;
		if (turned && currentId() === now.id) locate(now.id).catch(() => {});
	});
}

/**
 * Follow the address bar.
 *
 * An effect of signals and not of a component: those wait for the next frame, and a key pressed
 * before it would speak about a group that the person has already left.
 */
export function startArrivals() {
	effect(() => {
		const at = page.value;
		// Another query has other neighbours.
		query.value;
		untracked(() => {
			if (at.page !== 'review') {
				resetForGroup();
				absent.value = 0;
				if (said && notice.value === said) dismiss();
			} else if (at.group === null) enterFirst();
			else enter(at.group);
		});
	});
	followVerdict();
}
