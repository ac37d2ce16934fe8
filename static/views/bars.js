// @ts-check
/** Bars below the header: what went wrong. They block nothing; a key that does nothing is explained on the header. */

import { html } from 'htm/preact';
import { useRef } from 'preact/hooks';

import { plural } from '../lib/format.js';
import { announced, dismiss, notice } from '../state/notice.js';
import { barred, discard } from '../state/outbox.js';
import { tryBarred } from '../state/sending.js';
import { MaintenanceBar } from './maintenance_bar.js';

/** What waits here because the person may not do it. */
function BarredBar() {
	const waiting = barred.value;
	if (waiting.length === 0) return null;
	return html`
		<div class="bar" data-tone="bad" role="alert">
			<p>${plural(waiting.length, 'change')} ${waiting.length === 1 ? 'is' : 'are'} not saved: ${waiting[0].barred}. This browser stores ${waiting.length === 1 ? 'it' : 'them'} until your role allows saving.</p>
			<button class="button" type="button" onClick=${tryBarred}>Try again</button>
			<button class="button" type="button" onClick=${() => discard((item) => Boolean(item.barred))}>Discard ${waiting.length === 1 ? 'it' : 'them'}</button>
		</div>
	`;
}

export function NoticeBar() {
	return html`<${MaintenanceBar} /><${BarredBar} /><${Notice} />`;
}

function Notice() {
	const present = notice.value;
	if (!present) return null;
	const { text, tone, action } = present;
	return html`
		<div class="bar" data-tone=${tone} role=${tone === 'bad' ? 'alert' : 'status'}>
			<p>${text}</p>
			${action ? html`<button class="button" type="button" onClick=${() => { dismiss(); action.run(); }}>${action.label}</button>` : null}
			<button class="button" type="button" onClick=${dismiss}>Dismiss <kbd>Esc</kbd></button>
		</div>
	`;
}

/** Says to screen readers what just happened, and shows for a moment why nothing did. */
export function Announcer() {
	const said = announced.value;
	const times = useRef({ said, count: 0 });
	// A new element each time: the same sentence is read out, and shown, once more.
	if (times.current.said !== said) times.current = { said, count: times.current.count + 1 };
	return html`<p class=${said.shown ? 'explained' : 'hidden-text'} role="status" aria-live="polite"><span key=${times.current.count}>${said.text}</span></p>`;
}
