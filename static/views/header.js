// @ts-check
/** The bar on top: where one is, the way to every other place, and what is saved. */

import { html } from 'htm/preact';

import { dataset } from '../state/datasets.js';
import { groupDocument } from '../state/group.js';
import { myName } from '../state/me.js';
import { lastGroupAddress, query, queueAddress } from '../state/navigation.js';
import { openHelp } from '../state/workspace.js';
import { NotificationsButton } from './comments/notifications_button.js';
import { DatasetMenu, pageAddress } from './dataset_menu.js';
import { SaveState } from './save_state.js';

/** @import {ComponentChildren} from 'preact' */

/** The pages of a dataset that stand in the header, the optional one where there is room; the menu has them all. */
const PAGES = [
	{ name: 'yield', label: 'Yield' },
	{ name: 'versions', label: 'Versions', optional: true },
	{ name: 'evaluation', label: 'Evaluation' },
];

/** @param {{current: string, name: string}} props */
function Navigation({ current, name }) {
	/** @param {string} page */
	const mark = (page) => (current === page ? 'page' : undefined);
	return html`
		<nav class="header__nav" aria-label="Pages">
			<a href=${lastGroupAddress(name)} aria-current=${mark('review')}>Review</a>
			<a href=${queueAddress(name, query.value)} aria-current=${mark('queue')}>Queue</a>
			${PAGES.map((page) => html`
				<a
					key=${page.name} class=${page.optional ? 'header__optional' : undefined} aria-current=${mark(page.name)}
					href=${name ? pageAddress(name, page.name) : '/datasets'}
				>${page.label}</a>`)}
		</nav>
	`;
}

/** @param {{current: string, of?: string, children?: ComponentChildren}} props `current` names the page, `of` its dataset where the address does not */
export function Header({ current, of, children }) {
	const ofGroup = current === 'review' || current === 'calibration';
	const group = ofGroup ? groupDocument.value : null;
	const name = group?.dataset.name ?? of ?? dataset.value?.name ?? '';
	return html`
		<header class="header">
			<a class="header__brand" href="/groups">Touchline</a>
			<${DatasetMenu} current=${current} name=${name} />
			<${Navigation} current=${current} name=${name} />
			${children ?? html`<span class="header__middle"></span>`}
			${ofGroup ? null : html`<${SaveState} elsewhere=${true} />`}
			<${NotificationsButton} />
			${myName.value ? html`<a class="header__person" href="/account" title="Your account, sessions and password" aria-current=${current === 'account' ? 'page' : undefined}>${myName.value}</a>` : null}
			<button class="header__help" type="button" aria-label="Help" title="Help: keys, legend, glossary, guide, practice" onClick=${openHelp}><kbd>?</kbd></button>
		</header>
	`;
}
