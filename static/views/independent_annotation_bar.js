// @ts-check
/** The bar over a group that is somebody's own annotation: of what, whose, and the way to hand it in. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { listen } from '../api/events.js';
import { getIndependentAnnotation, postSubmission } from '../api/independent_annotations.js';
import { ApiError, sentenceOf } from '../api/problem.js';
import { useResource } from '../lib/resource.js';
import { groupDocument } from '../state/group.js';
import { askReturn, askTakeOver, canReturn, canTakeOver, take as onScreen } from '../state/return_group.js';
import { complain } from '../state/notice.js';
import { isTeam, myName } from '../state/me.js';
import { ReturnedNote } from './lease_bar.js';

/** @import {GroupDocument} from '../api/types.js' */

/** @param {{group: GroupDocument}} props */
function Bar({ group }) {
	const { value: found, error, reload } = useResource((signal) => getIndependentAnnotation(group.id, signal), [group.id, group.verdict.at]);
	const [busy, setBusy] = useState(false);
	useEffect(() => listen('group', (told) => { if (told.group === group.id && told.kind === 'take') reload(); }, reload), [group.id, reload]);
	useEffect(() => {
		onScreen.value = found;
		return () => { onScreen.value = null; };
	}, [found]);
	const take = onScreen.value ?? found;
	async function handIn() {
		setBusy(true);
		try {
			await postSubmission(group.id);
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			complain(sentenceOf(problem));
		}
		setBusy(false);
		reload();
	}
	if (error || !take) return null;
	const mine = !isTeam || take.person === myName.value;
	const whose = mine ? 'your independent annotation' : `${take.person}’s annotation`;
	const state = take.settled ? 'The group is decided: this annotation, or another one, is used.' : take.submitted ? `It is submitted and can no longer be changed${mine && isTeam ? '; only a lead can return it' : ''}.` : mine ? 'Only you and the leads see it.' : 'It is not submitted yet.';
	return html`
		<div class="bar take-bar" data-tone=${take.returned ? 'info' : undefined} role="status">
			<p><strong>${take.number === null || mine ? take.title : `${take.number} · ${take.title}`}</strong>, ${whose}. ${take.returned ? html`<${ReturnedNote} back=${take.returned} />` : state}</p>
			${canReturn.value ? html`<button class="button" type="button" onClick=${askReturn}>Return… <kbd>⇧U</kbd></button>` : null}
			${canTakeOver.value ? html`<button class="button" type="button" onClick=${askTakeOver}>Apply to the group… <kbd>⇧R</kbd></button>` : null}
			${take.of && take.settled ? html`<a class="button" href=${`/review/${take.of}`}>Open the group</a>` : null}
			${mine && !take.submitted && take.batch === null ? html`<button class="button button--primary" type="button" disabled=${busy} onClick=${handIn}>Submit</button>` : null}
		</div>
	`;
}

export function IndependentAnnotationBar() {
	const group = groupDocument.value;
	return group ? html`<${Bar} key=${group.id} group=${group} />` : null;
}
