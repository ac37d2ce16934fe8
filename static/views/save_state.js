// @ts-check
/** Whether everything is saved, and the way to what is not. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { ago, plural } from '../lib/format.js';
import { useNow } from '../lib/hooks.js';
import { page } from '../lib/router.js';
import { held } from '../state/conflict.js';
import { editorAddress } from '../state/editor_address.js';
import { groupDocument, unsaved } from '../state/group.js';
import { changedElsewhere } from '../state/live.js';
import { reviewAddress } from '../state/navigation.js';
import { lasting } from '../state/outbox.js';
import { stagedIn } from '../state/staging.js';
import { busyWith, isAway, isSending, savedAt, waiting, wake, wasRefused } from '../state/sending.js';

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

/** The way back to a group whose conflict waits. @param {{shown: number | undefined}} props the group on screen, whose conflict needs no link */
function ConflictLink({ shown }) {
	const other = held.value.find(({ group }) => group !== shown);
	if (!other) return null;
	return html`<a class="save__conflict" href=${reviewAddress(other.group)} title="Opens the group with your unsaved changes">Go to the conflict</a>`;
}

/** The way to what is staged in the calibration editor and not saved. */
function StagedLink() {
	const group = groupDocument.value;
	const { count, view } = group ? stagedIn(group) : { count: 0 };
	if (!group || !view || page.value.page !== 'review') return null;
	return html`<a class="save__conflict" href=${editorAddress(group.id, view)} title="Open the calibration editor">${plural(count, 'marking')} staged, not saved</a>`;
}

/** @param {{elsewhere?: boolean}} props `elsewhere`: no group is on screen, so that only what is not saved is worth a word */
export function SaveState({ elsewhere = false }) {
	const now = useNow(1000);
	const { state, words } = saveState();
	const [slow, setSlow] = useState(false);
	useEffect(() => {
		const timer = setTimeout(() => setSlow(state === 'saving'), state === 'saving' ? SPINNER_AFTER : 0);
		return () => clearTimeout(timer);
	}, [state]);
	// A write that is answered at once is not worth a flicker.
	const quick = state === 'saving' && !slow;
	if (elsewhere && (quick || (held.value.length === 0 && waiting.value.length === 0))) return null;
	const text = quick ? (savedAt.value === null ? 'No changes' : `Saved ${ago(savedAt.value, now)}`) : words(now);
	const title = state !== 'away' ? '' : lasting.value
		? `Stored in this browser, and sent when the server ${busyWith.value ? `has time. It says: ${busyWith.value}` : 'can be reached'}`
		: 'This browser cannot store unsaved changes: do not close the page';
	return html`
		<${StagedLink} />
		<${ConflictLink} shown=${elsewhere ? undefined : groupDocument.value?.id} />
		<span class="save" data-state=${quick ? 'saved' : state} data-unsaved=${unsaved.value} title=${title}>
			<span class="save__dot" aria-hidden="true"></span>${text}
			<span class="hidden-text" role="status" aria-live="polite">${state === 'failed' || state === 'away' ? words(now) : ''}</span>
		</span>
		${state === 'away' ? html`<button class="button button--small" type="button" onClick=${() => wake()}>Try now</button>` : null}
	`;
}
