// @ts-check
/** What was handed in goes back to its person, or an annotation of somebody's own into the group that it is of. */

import { computed, signal } from '@preact/signals';

import { postAdoption, postAnnotationReturn } from '../api/independent_annotations.js';
import { postReturn } from '../api/work.js';
import { navigate } from '../lib/router.js';
import { groupDocument } from './group.js';
import { submitAndOpenNext, lease, nextOfBatch } from './leases.js';
import { isTeam, myName } from './me.js';
import { currentId, reviewAddress } from './navigation.js';
import { announce, complain, inform } from './notice.js';
import { whyNot } from './rights.js';

/** @import {IndependentAnnotationJson} from '../api/independent_annotations.js' */

/** The group on screen as somebody's own annotation; null: it is none, or nobody knows yet. */
export const take = signal(/** @type {IndependentAnnotationJson | null} */ (null));

/**
 * What is asked before it is done; null: nothing.
 *
 * @typedef {{kind: 'back' | 'over', person: string, says: string, send: (reason: string) => Promise<void>}} Question
 */
export const question = signal(/** @type {Question | null} */ (null));

/** Whether the group on screen is somebody's own annotation that is handed in and open, and that a lead looks at. */
const isReady = computed(() => {
	const [one, group] = [take.value, groupDocument.value];
	return isTeam && one !== null && group?.id === one.group && one.person !== myName.value
		&& one.submitted !== null && one.settled === null && whyNot('lead', group.dataset.name) === '';
});

/** Why nobody judges the annotation on screen now; empty: it can be judged. */
export const frozen = computed(() => {
	const one = take.value;
	if (one === null || one.group !== groupDocument.value?.id) return '';
	if (one.settled !== null) return 'This annotation was adjudicated already; it can no longer be changed.';
	const mine = !isTeam || one.person === myName.value;
	if (one.submitted !== null) return mine ? 'This annotation is submitted; only a lead can return it.' : `${one.person} has submitted this group; return it, or take it over.`;
	return mine ? '' : `${one.person} reviews this annotation.`;
});

/** Submit the group and go on, unless it was submitted already. */
export async function submitAndNext() {
	if (frozen.value) complain(frozen.value);
	else await submitAndOpenNext();
}

/** Whether it can be taken over into the group that it is of. */
export const canTakeOver = computed(() => isReady.value);

/** Whether what is on screen can be handed back. */
export const canReturn = computed(() => {
	const held = lease.value;
	return isReady.value || (held?.state === 'mine' && held.part === 'reviewer' && Boolean(held.submittedBy) && held.submittedBy !== myName.value);
});

/** Ask why the group on screen goes back to its annotator. */
export function askReturn() {
	const [one, held] = [take.value, lease.value];
	if (!canReturn.value) return;
	if (isReady.value && one) {
		question.value = {
			kind: 'back', person: one.person,
			says: `${one.person} sees the reason, can change this annotation, and submits it again. If others annotated the group too, nothing is decided until then.`,
			send: async (reason) => {
				take.value = await postAnnotationReturn(one.group, reason);
				announce(`The annotation was returned to ${one.person}.`);
			},
		};
	} else if (held?.submittedBy) {
		const person = held.submittedBy;
		question.value = {
			kind: 'back', person, says: `${person} sees the reason and gets this group next; you go to your next group.`,
			send: async (reason) => {
				await postReturn(held.batch, held.group, reason);
				announce(`The annotation was returned to ${person}.`);
				await nextOfBatch();
				// Who stays would have open what the annotator gets next.
				if (currentId() === held.group) navigate('/work');
			},
		};
	}
}

/** Ask whether the annotation on screen shall count. */
export function askTakeOver() {
	const one = take.value;
	if (!canTakeOver.value || !one) return;
	question.value = {
		kind: 'over', person: one.person,
		says: `The changes of ${one.person}, and their verdict${one.verdict ? ` (${one.verdict})` : ''}, are applied to the group under their name. This annotation can then no longer be changed, and other people’s annotations of the group are not used. Undo in the group reverts the change.`,
		send: async () => {
			const { id } = await postAdoption(one.group);
			navigate(reviewAddress(id));
			inform(`${one.person}’s annotation is applied to the group. Undo (Ctrl Z) reverts the change.`);
		},
	};
}
