// @ts-check
/** The header of the review screen: which group, where in the queue, saved or not. */

import { html } from 'htm/preact';

import { count } from '../lib/format.js';
import { groupDocument } from '../state/group.js';
import { redo, redoable, undo, undoable } from '../state/undo.js';
import { batchId, goNext, goPrevious, neighbours, query, queueAddress } from '../state/navigation.js';
import { standing } from '../state/walk.js';
import { batch, lease } from '../state/leases.js';
import { isCopy } from '../state/independent_annotations.js';
import { openThreads } from '../state/threads.js';
import { isBlind } from '../state/verdicts.js';
import { Header } from './header.js';
import { Presence } from './lease_bar.js';
import { SaveState } from './save_state.js';
import { OpenComments } from './comments/open_comments.js';

/** @import {Standing} from '../state/walk.js' */

/** "group 3 of 6". @param {Standing} at */
function placeText({ place, total }) {
	return place === null ? `not in this queue of ${count(total)}` : `group ${count(place)} of ${count(total)}`;
}

/** Where a copy stands: it is in no queue, and its place is among those of its person. */
function OwnPlace() {
	const held = lease.value?.group === groupDocument.value?.id ? lease.value : null;
	if (!held?.place) return null;
	return html`
		<span class="header__place">
			<a href="/work" title="Back to my work">group ${count(held.place)}${held.of ? ` of ${count(held.of)}` : ''}</a>
			<span class="header__queue"> in ${batch.value?.name ?? 'a batch'}</span>
		</span>
	`;
}

function Place() {
	const at = standing.value;
	const group = groupDocument.value;
	if (isCopy(group)) return html`<${OwnPlace} />`;
	if (!group || !at) return null;
	// Who does not have the group has not been told what its batch is called.
	const named = batch.value?.id === batchId.value && batch.value?.name;
	const queue = named || (batchId.value === null ? query.value || group.dataset.name : 'a batch');
	const { done, left } = at;
	return html`
		<span class="header__place">
			<a href=${queueAddress(group.dataset.name, query.value)} title=${`Back to the queue: ${queue}`}>${placeText(at)}</a>
			<span class="header__queue"> in ${queue}</span>
			${left !== null && done > 0 ? html`<span class="header__done" title=${`Counted since you began this queue, which then had ${count(at.total)} groups`}> · ${count(done)} done, ${count(left)} left</span>` : null}
		</span>
	`;
}

/** @param {{label: string, keys: string, run: () => unknown, reason: string | null, path: string}} props */
function HeaderButton({ label, keys, run, reason, path }) {
	return html`
		<button
			class="icon-button" type="button" aria-label=${label} aria-disabled=${reason !== null}
			title=${reason ?? `${label} (${keys})`} onClick=${() => run()}
		><svg viewBox="0 0 16 16" aria-hidden="true"><path d=${path} /></svg></button>
	`;
}

/** @param {Event} event */
function toComments(event) {
	event.preventDefault();
	document.querySelector('.talk')?.scrollIntoView({ block: 'nearest' });
}

export function ReviewHeader() {
	const group = groupDocument.value;
	const at = neighbours.value;
	// Where there is little room the match is cut, not the moment, which tells the groups apart.
	const [match, ...when] = (group?.label ?? '').split(' · ');
	return html`
		<${Header} current="review">
			<div class="header__middle">
				<${HeaderButton} label="Previous group" keys="D" run=${goPrevious} path="M10 3 5 8l5 5"
					reason=${at && !at.previous.length ? 'This is the first group of the queue' : null} />
				<span class="header__where">
					<strong class="header__group" title=${group ? `${group.label} (${group.key})` : ''}><span>${match}</span>${when.length ? html`<span class="header__when"> · ${when.join(' · ')}</span>` : null}</strong> ${group && isBlind(group) ? html`<span class="pill" data-status="no-picture">no picture</span> ` : null}${openThreads.value ? html`<a class="header__comments" href="#talk-title" onClick=${toComments}><${OpenComments} count=${openThreads.value} /></a>` : null}<${Place} />
				</span>
				<${HeaderButton} label="Next group" keys="F" run=${goNext} path="m6 3 5 5-5 5"
					reason=${at && !at.next.length ? 'This is the last group of the queue' : null} />
			</div>
			<${Presence} />
			<${SaveState} />
			<${HeaderButton} label="Undo" keys="Ctrl Z" run=${undo} path="M6 3 3 6l3 3M3 6h6a4 4 0 0 1 0 8H6"
				reason=${undoable.value ? null : 'Nothing to undo in this group'} />
			<${HeaderButton} label="Redo" keys="Ctrl Shift Z" run=${redo} path="m10 3 3 3-3 3M13 6H7a4 4 0 0 0 0 8h3"
				reason=${redoable.value ? null : 'Nothing to redo in this group'} />
		<//>
	`;
}
