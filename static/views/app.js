// @ts-check
/** Which page is shown. */

import { html } from 'htm/preact';

import { useKeys } from '../lib/hooks.js';
import { page } from '../lib/router.js';
import { helpOpen } from '../state/workspace.js';
import { Announcer } from './bars.js';
import { Help } from './help.js';
import { QueuePage } from './queue_page.js';
import { ReviewPage } from './review_page.js';

/** @type {import('../lib/keys.js').Binding[]} */
const GLOBAL_KEYS = [
	{ keys: ['?', 'Shift+?'], label: 'This page', group: 'Everywhere', shown: '?', run: () => { helpOpen.value = true; } },
];

function UnknownPage() {
	return html`
		<main class="review__empty">
			<h1>There is no such page</h1>
			<p><a href="/groups">Open the queue</a></p>
		</main>
	`;
}

function Page() {
	const { page: name } = page.value;
	if (name === 'queue') return html`<${QueuePage} />`;
	if (name === 'review') return html`<${ReviewPage} />`;
	return html`<${UnknownPage} />`;
}

export function App() {
	useKeys(GLOBAL_KEYS);
	return html`<${Page} /><${Help} /><${Announcer} />`;
}
