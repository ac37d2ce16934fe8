// @ts-check
/** Which page is shown. */

import { html } from 'htm/preact';
import { useEffect } from 'preact/hooks';

import { loggedOut } from '../api/client.js';
import { useKeys } from '../lib/hooks.js';
import { lazy } from '../lib/lazy.js';
import { page } from '../lib/router.js';
import { isTeam, me, mustLogIn } from '../state/me.js';
import { openPalette, paletteOpen } from '../state/palette.js';
import { helpOpen, openHelp } from '../state/workspace.js';
import { Announcer } from './bars.js';
import { Header } from './header.js';
import { LazyPage, loadPage } from './lazy_page.js';
import { openNotifications } from './comments/notifications_button.js';
import { LoginAgain, LoginPage } from './login.js';
import { ReviewPage } from './review_page.js';
import { explainTerms } from './term.js';

/** Milliseconds. */
const FETCH_AHEAD_AFTER = 1500;

/** @type {import('../lib/keys.js').Binding[]} */
const GLOBAL_KEYS = [
	{ keys: ['?', 'Shift+?'], label: 'Help: keys, legend, glossary, guide, practice', group: 'Everywhere', shown: '?', run: openHelp },
	{ keys: ['Ctrl+k'], label: 'Go to a page, dataset, group or action', group: 'Everywhere', typing: true, run: openPalette },
	...(isTeam ? [{ keys: ['Shift+b'], label: 'Notifications', group: 'Everywhere', run: openNotifications }] : []),
	// Pages with a search field of their own bind it to that.
	{ keys: ['/'], label: 'Search', group: 'Everywhere', run: openPalette },
];

const Help = lazy(async () => (await import('./help/help_dialog.js')).Help);
const EnrolPage = lazy(async () => (await import('./enrol_page.js')).EnrolPage);
const Palette = lazy(async () => (await import('./palette.js')).Palette);

function UnknownPage() {
	return html`
		<div class="page">
			<${Header} current="" />
			<main class="page__main">
				<section class="card empty">
					<h1>There is no such page</h1>
					<p><a class="button" href="/groups">Open the queue</a></p>
				</section>
			</main>
		</div>
	`;
}

function Page() {
	const { page: name } = page.value;
	if (name === 'review') return html`<${ReviewPage} />`;
	if (name === 'unknown') return html`<${UnknownPage} />`;
	return html`<${LazyPage} name=${name} />`;
}

/** What is one key away is fetched once the first screen stands. */
function fetchAhead() {
	Promise.all([
		import('./palette.js'), import('./help/help_dialog.js'), import('./loupe.js'),
		import('./adjust_popover.js'), import('./conflict_bar.js'), loadPage('queue'),
	]).catch(() => {
		// It is asked for again, and complained about, when somebody goes there.
	});
}

export function App() {
	const { page: name } = page.value;
	// The way back from the provider, whoever is there.
	if (name === 'login') return html`<${LazyPage} key="login" name="login" />`;
	if (mustLogIn.value && me.value === null && name !== 'join') return html`<${LoginPage} />`;
	if (me.value?.enrol && !loggedOut.value) return html`<${EnrolPage} />`;
	return html`<${Everything} />${mustLogIn.value && me.value ? html`<${LoginAgain} />` : null}`;
}

function Everything() {
	useKeys(GLOBAL_KEYS);
	useEffect(explainTerms, []);
	useEffect(() => {
		const timer = setTimeout(fetchAhead, FETCH_AHEAD_AFTER);
		return () => clearTimeout(timer);
	}, []);
	return html`<${Page} />${helpOpen.value && page.value.page !== 'help' ? html`<${Help} key=${helpOpen.value} opening=${helpOpen.value} />` : null}${paletteOpen.value ? html`<${Palette} key=${paletteOpen.value} />` : null}<${Announcer} />`;
}
