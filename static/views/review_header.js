// @ts-check
/** The header of the review screen: which group, where in the queue, saved or not. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { ago, count } from '../lib/format.js';
import { useNow } from '../lib/hooks.js';
import { document as groupDocument, save, unsaved } from '../state/group.js';
import { canRedo, canUndo, redo, undo } from '../state/history.js';
import { goNext, goPrevious, neighbours, query, queueAddress } from '../state/navigation.js';
import { Header } from './header.js';

/** Saving is worth a word only when it takes long enough to wonder. */
const SPINNER_AFTER = 300;

function SaveState() {
	const now = useNow(1000);
	const { state, at } = save.value;
	const [slow, setSlow] = useState(false);
	useEffect(() => {
		const timer = setTimeout(() => setSlow(state === 'saving'), state === 'saving' ? SPINNER_AFTER : 0);
		return () => clearTimeout(timer);
	}, [state]);
	const text = state === 'failed' ? 'Not saved' : slow ? 'Saving…'
		: at === null ? 'No changes' : `Saved ${ago(at, now)}`;
	return html`
		<span class="save" data-state=${state === 'saving' && !slow ? 'saved' : state} data-unsaved=${unsaved.value}>
			<span class="save__dot" aria-hidden="true"></span>${text}
			<span class="hidden-text" role="status" aria-live="polite">${state === 'failed' ? 'Not saved' : ''}</span>
		</span>
	`;
}

function Place() {
	const at = neighbours.value;
	const group = groupDocument.value;
	if (!group || at?.id !== group.id) return null;
	const place = at.index === null ? `${count(at.total)} in` : `group ${count(at.index + 1)} of ${count(at.total)} in`;
	return html`
		<span class="header__place">${place} <a href=${queueAddress(group.dataset.name, query.value)}>${query.value || group.dataset.name}</a></span>
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

export function ReviewHeader() {
	const group = groupDocument.value;
	const at = neighbours.value;
	return html`
		<${Header} current="review">
			<div class="header__middle">
				<${HeaderButton} label="Previous group" keys="D" run=${goPrevious} path="M10 3 5 8l5 5"
					reason=${at && !at.previous.length ? 'This is the first group of the queue' : null} />
				<span class="header__where">
					<strong title=${group?.key ?? ''}>${group?.label ?? ''}</strong> <${Place} />
				</span>
				<${HeaderButton} label="Next group" keys="F" run=${goNext} path="m6 3 5 5-5 5"
					reason=${at && !at.next.length ? 'This is the last group of the queue' : null} />
			</div>
			<${SaveState} />
			<${HeaderButton} label="Undo" keys="Ctrl Z" run=${undo} path="M6 3 3 6l3 3M3 6h6a4 4 0 0 1 0 8H6"
				reason=${canUndo.value ? null : 'Nothing to undo in this group'} />
			<${HeaderButton} label="Redo" keys="Ctrl Shift Z" run=${redo} path="m10 3 3 3-3 3M13 6H7a4 4 0 0 0 0 8h3"
				reason=${canRedo.value ? null : 'Nothing to redo in this group'} />
		<//>
	`;
}
