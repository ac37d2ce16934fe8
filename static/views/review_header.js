// @ts-check
/** The header of the review screen: which group, where in the queue, saved or not. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { ago, count } from '../lib/format.js';
import { useNow } from '../lib/hooks.js';
import { held } from '../state/conflict.js';
import { groupDocument, unsaved } from '../state/group.js';
import { redo, redoable, undo, undoable } from '../state/undo.js';
import { batchId, goNext, goPrevious, neighbours, query, queueAddress, reviewAddress } from '../state/navigation.js';
import { standing } from '../state/walk.js';
import { batch, lease } from '../state/leases.js';
import { isCopy } from '../state/independent_annotations.js';
import { changedElsewhere } from '../state/live.js';
import { lasting } from '../state/outbox.js';
import { busyWith, isAway, isSending, savedAt, waiting, wake, wasRefused } from '../state/sending.js';
import { openThreads } from '../state/threads.js';
import { isBlind } from '../state/verdicts.js';
import { Header } from './header.js';
import { Presence } from './lease_bar.js';
import { OpenComments } from './comments/open_comments.js';

/** @import {Standing} from '../state/walk.js' */

/** Saving is worth a word only when it takes long enough to wonder. */
const SPINNER_AFTER = 300;
/** How long a change that was made elsewhere is news, ms. */
const NEWS = 8000;

/** @returns {{state: 'saved' | 'saving' | 'away' | 'failed', words: (now: number) => string}} */
function saveState() {
	const here = waiting.value.length;
	if (isAway.value && here > 0) {
		const why = busyWith.value ? 'Server busy' : 'Offline';
		return { state: 'away', words: () => `${why} · ${here} ${here === 1 ? 'change waits' : 'changes wait'}` };
	}
	if (held.value.length > 0) return { state: 'failed', words: () => 'Not saved: conflict' };
	if (here > 0 || isSending.value) return { state: 'saving', words: () => 'Saving…' };
	if (wasRefused.value) return { state: 'failed', words: () => 'Not saved' };
	const news = changedElsewhere.value;
	const fresh = (/** @type {number} */ now) => news !== null && news.group === groupDocument.value?.id
		&& news.at > (savedAt.value ?? 0) && now - news.at < NEWS;
	const at = savedAt.value;
	if (fresh(Date.now())) {
		const who = news?.actor && news.actor !== 'local' ? `by ${news.actor}` : 'elsewhere';
		return { state: 'saved', words: () => `Changed ${who} just now` };
	}
	return { state: 'saved', words: (now) => (at === null ? 'No changes' : `Saved ${ago(at, now)}`) };
}

/** The way back to a group whose conflict waits. */
function ConflictLink() {
	const other = held.value.find(({ group }) => group !== groupDocument.value?.id);
	if (!other) return null;
	return html`<a class="save__conflict" href=${reviewAddress(other.group)} title="The group whose changes were not saved">Go to the conflict</a>`;
}

export function SaveState() {
	const now = useNow(1000);
	const { state, words } = saveState();
	const [slow, setSlow] = useState(false);
	useEffect(() => {
		const timer = setTimeout(() => setSlow(state === 'saving'), state === 'saving' ? SPINNER_AFTER : 0);
		return () => clearTimeout(timer);
	}, [state]);
	// A write that is answered at once is not worth a flicker.
	const quick = state === 'saving' && !slow;
	const text = quick ? (savedAt.value === null ? 'No changes' : `Saved ${ago(savedAt.value, now)}`) : words(now);
	const title = state !== 'away' ? '' : lasting.value
		? `Stored in this browser, and sent when the server ${busyWith.value ? `has time. It says: ${busyWith.value}` : 'can be reached'}`
		: 'This browser cannot store unsaved changes: do not close the page';
	return html`
		<${ConflictLink} />
		<span class="save" data-state=${quick ? 'saved' : state} data-unsaved=${unsaved.value} title=${title}>
			<span class="save__dot" aria-hidden="true"></span>${text}
			<span class="hidden-text" role="status" aria-live="polite">${state === 'failed' || state === 'away' ? words(now) : ''}</span>
		</span>
		${state === 'away' ? html`<button class="button button--small" type="button" onClick=${() => wake()}>Try now</button>` : null}
	`;
}

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
