// @ts-check
/** The one place where the dataset is chosen, and from which every page is reached. */

import { html } from 'htm/preact';
import { useRef, useState } from 'preact/hooks';

import { count } from '../lib/format.js';
import { datasets, loadDatasets, useDataset } from '../state/datasets.js';
import { isTeam, may } from '../state/me.js';
import { whyNot } from '../state/rights.js';
import { queueAddress } from '../state/navigation.js';

/** @import {DatasetJson} from '../api/types.js' */

export const DATASET_PAGES = [
	{ name: 'queue', label: 'Queue' },
	{ name: 'yield', label: 'Yield' },
	{ name: 'policy', label: 'Policy' },
	{ name: 'statistics', label: 'Statistics' },
	{ name: 'tracks', label: 'Tracks' },
	{ name: 'versions', label: 'Versions' },
	{ name: 'agreement', label: 'Agreement' },
	{ name: 'evaluation', label: 'Evaluation' },
];

const PLAIN_PAGES = [
	{ name: 'work', label: 'My work', href: '/work' },
	{ name: 'datasets', label: 'Datasets', href: '/datasets' },
	{ name: 'import', label: 'Import', href: '/import' },
	{ name: 'recordings', label: 'Recordings', href: '/recordings' },
	{ name: 'jobs', label: 'Jobs', href: '/jobs' },
	{ name: 'exports', label: 'Exports', href: '/exports' },
	{ name: 'help', label: 'Help', href: '/help' },
];

const TEAM_PAGES = /** @type {const} */ ([
	{ name: 'account', label: 'Account', href: '/account', action: 'account' },
	{ name: 'people', label: 'People', href: '/people', action: 'administer' },
]);

/** Pages that belong to no dataset, for whoever is there. */
export function plainPages() {
	const audit = whyNot('lead') === '' ? [{ name: 'audit', label: 'Audit', href: '/audit' }] : [];
	return [...PLAIN_PAGES, ...audit, ...(isTeam ? TEAM_PAGES.filter(({ action }) => may(action)) : [])];
}

/** The address of a page of a dataset. @param {string} dataset @param {string} page */
export function pageAddress(dataset, page) {
	return page === 'queue' ? queueAddress(dataset, '') : `/datasets/${encodeURIComponent(dataset)}/${page}`;
}

/** Another dataset keeps the page, where a dataset has that page. @param {string} current */
function staying(current) {
	return DATASET_PAGES.some(({ name }) => name === current) ? current : 'queue';
}

/** @param {{one: DatasetJson, name: string, current: string}} props */
function DatasetLink({ one, name, current }) {
	return html`
		<li>
			<a
				href=${pageAddress(one.name, staying(current))} aria-current=${one.name === name ? 'true' : undefined}
				onClick=${() => useDataset(one.name)}
			>
				<span class="menu__name">${one.name}</span>
				<span class="menu__aside">${count(one.accepted + one.rejected)} of ${count(one.groups)} reviewed</span>
			</a>
		</li>
	`;
}

/** @param {{current: string, name: string}} props */
function MenuBody({ current, name }) {
	/** @param {string} page */
	const mark = (page) => (page === current ? 'page' : undefined);
	const all = datasets.value ?? [];
	return html`
		<section aria-labelledby="menu-datasets">
			<h2 id="menu-datasets">Datasets</h2>
			${datasets.value === null ? html`<p class="empty-note">Reading…</p>` : null}
			<ul class="menu__datasets">
				${all.map((one) => html`<${DatasetLink} key=${one.id} one=${one} name=${name} current=${current} />`)}
			</ul>
		</section>
		${name ? html`
			<section aria-labelledby="menu-pages">
				<h2 id="menu-pages">${name}</h2>
				<ul>${DATASET_PAGES.map((page) => html`
					<li key=${page.name}><a href=${pageAddress(name, page.name)} aria-current=${mark(page.name)}>${page.label}</a></li>`)}
				</ul>
			</section>` : null}
		<section aria-labelledby="menu-everywhere">
			<h2 id="menu-everywhere">All datasets</h2>
			<ul>${plainPages().map((page) => html`
				<li key=${page.name}><a href=${page.href} aria-current=${mark(page.name)}>${page.label}</a></li>`)}
			</ul>
			<p class="empty-note"><kbd>Ctrl K</kbd> searches everything</p>
		</section>
	`;
}

/** @param {{current: string, name: string}} props */
export function DatasetMenu({ current, name }) {
	const menu = useRef(/** @type {HTMLDivElement | null} */ (null));
	const [open, setOpen] = useState(false);
	/** @param {ToggleEvent} event */
	function toggled(event) {
		const opened = event.newState === 'open';
		setOpen(opened);
		if (opened) loadDatasets();
	}
	/** @param {MouseEvent} event */
	function clicked(event) {
		if (event.target instanceof Element && event.target.closest('a')) menu.current?.hidePopover();
	}
	return html`
		<button class="header__dataset" type="button" popovertarget="dataset-menu" aria-haspopup="true" aria-expanded=${open}>
			<span class="hidden-text">Dataset and pages: </span><span class="header__dataset-name">${name || 'Datasets'}</span>
			<svg viewBox="0 0 10 6" aria-hidden="true"><path d="m1 1 4 4 4-4" /></svg>
		</button>
		<div class="menu" id="dataset-menu" popover ref=${menu} onToggle=${toggled} onClick=${clicked}>
			${open ? html`<${MenuBody} current=${current} name=${name} />` : null}
		</div>
	`;
}
