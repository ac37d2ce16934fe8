// @ts-check
/** What every page but the review screen has: the header, the bars below it, one scrolling part. */

import { html } from 'htm/preact';
import { useEffect } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { datasets, loadDatasets } from '../state/datasets.js';
import { dismiss } from '../state/notice.js';
import { NoticeBar } from './bars.js';
import { Header } from './header.js';

/** @import {ComponentChildren} from 'preact' */

/**
 * @param {{
 *   current: string, of?: string, title: string, where?: ComponentChildren, actions?: ComponentChildren,
 *   children?: ComponentChildren
 * }} props `of`: see `Header`; `where` stands in the middle of the header, `actions` at its right
 */
export function PageFrame({ current, of, title, where, actions, children }) {
	useEffect(() => { document.title = `${title} · Touchline`; }, [title]);
	useEffect(() => { if (datasets.value === null) loadDatasets(); }, []);
	// A notice speaks about the page on which it came up.
	useEffect(() => dismiss, []);
	return html`
		<div class="page">
			<${Header} current=${current} of=${of}>
				<div class="header__middle"><span class="header__where">${where}</span></div>
				${actions}
			<//>
			<div class="bars"><${NoticeBar} /></div>
			<main class="page__main" data-page=${current}>
				<h1 class="hidden-text">${title}</h1>
				${children}
			</main>
		</div>
	`;
}

/** In place of a page about accounts where one person works alone. @param {{current: string, title: string}} props */
export function NoAccounts({ current, title }) {
	return html`
		<${PageFrame} current=${current} title=${title} where=${html`<strong>${title}</strong>`}>
			<section class="card empty">
				<h2>There are no accounts</h2>
				<p>One person works alone on this server, so nobody logs in. <code>touchline serve --team</code> requires a login.</p>
			</section>
		<//>
	`;
}

/** @param {{what: string}} props */
export function Loading({ what }) {
	return html`<p class="page__loading" role="status">Reading ${what}…</p>`;
}

/**
 * The card of a list without an item: of what the person sees, where more is hidden from them; else what `children` says.
 *
 * @param {{what: string, title: string, children?: ComponentChildren}} props `what`: "jobs"
 */
export function Empty({ what, title, children }) {
	const hiding = (datasets.value ?? []).filter((one) => one.hides_groups).map(({ name }) => name);
	return html`
		<section class="card empty">
			<h2>${hiding.length ? `No ${what} to show` : title}</h2>
			${hiding.length ? html`<p data-hidden-groups>The ${what} of ${hiding.join(' and ')} are hidden from you until the batch that you annotate independently is closed.</p>` : children}
		</section>
	`;
}

/** @param {{title: string, error: Error, retry?: () => void}} props */
export function Trouble({ title, error, retry }) {
	return html`
		<section class="card empty" role="alert">
			<h2>${title}</h2>
			<p>${sentenceOf(error)}</p>
			${retry ? html`<p><button class="button" type="button" onClick=${retry}>Try again</button></p>` : null}
		</section>
	`;
}
