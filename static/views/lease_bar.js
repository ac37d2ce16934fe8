// @ts-check
/** Who else has the group on screen open, and handing it in. */

import { html } from 'htm/preact';

import { ago } from '../lib/format.js';
import { useNow } from '../lib/hooks.js';
import { groupDocument } from '../state/group.js';
import { askReturn, canReturn, frozen, submitAndNext } from '../state/return_group.js';
import { isCopy } from '../state/independent_annotations.js';
import { batch, canSubmit, isMoving, lease, nextOfBatch, others, takeOver } from '../state/leases.js';

/** Others who are here, in the header. */
export function Presence() {
	const now = useNow(20_000);
	if (others.value.length === 0 || lease.value?.state !== 'mine') return null;
	return html`<span class="pill" role="status">${others.value.map(({ person, since }) => `${person} opened this ${ago(Date.parse(since), now)}`).join(', ')}</span>`;
}

/** Who handed something back, when and why. @param {{back: import('../api/independent_annotations.js').ReturnedJson}} props */
export function ReturnedNote({ back }) {
	const now = useNow(20_000);
	return html`<strong>${back.by}</strong> returned this ${ago(Date.parse(back.at), now)}${back.reason ? html`: “${back.reason}”` : '.'}`;
}

/** The button of who annotates: done, and on; of who reviews: back to them. */
export function SubmitButton() {
	if (canReturn.value && !isCopy(groupDocument.value)) {
		return html`<button class="button" type="button" title="Return this group to its annotator, with a reason (Shift U)" onClick=${askReturn}>Return to ${lease.value?.submittedBy}… <kbd>⇧U</kbd></button>`;
	}
	if (!canSubmit.value) return null;
	return html`<button class="button button--primary" type="button" aria-disabled=${isMoving.value || frozen.value !== ''} title=${frozen.value || 'Submit this group for review (Shift F)'} onClick=${submitAndNext}>Submit and next <kbd>⇧F</kbd></button>`;
}

/** Below the header: this group is somebody else's. It blocks nothing. */
export function LeaseBar() {
	const now = useNow(20_000);
	const held = lease.value;
	if (held?.state === 'mine' && held.back) return html`<div class="bar" data-tone="info" role="status"><p><${ReturnedNote} back=${held.back} /> Submit it again when it is fixed.</p></div>`;
	if (!held || held.state === 'mine') return null;
	const [other] = others.value;
	const since = other ? `${ago(Date.parse(other.since), now)}` : '';
	const text = held.state === 'lost' ? `${other ? `${other.person} has taken this group over, ${since}` : held.sentence}. Your changes are saved; new changes are checked against theirs.`
		: held.state === 'others' ? `${other ? `${other.person} opened this ${since}` : held.sentence}. You can view it; take it over to edit it.`
			: `${held.sentence}.`;
	return html`
		<div class="bar" data-tone="info" role="status" data-lease=${held.state}>
			<p>${text}</p>
			${held.state === 'none' ? html`<a class="button" href="/work">My work</a>` : html`
				<button class="button" type="button" data-needs="annotate" onClick=${takeOver}>${held.state === 'lost' ? 'Take it back' : 'Take over'}</button>
				<button class="button" type="button" data-needs="annotate" aria-disabled=${isMoving.value} onClick=${() => nextOfBatch()}>Next group${batch.value ? ` of ${batch.value.name}` : ''}</button>`}
		</div>
	`;
}
