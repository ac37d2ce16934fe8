// @ts-check
/** The bar on top: where one is, and what is saved. */

import { html } from 'htm/preact';

import { dataset } from '../state/datasets.js';
import { lastGroup, query, queueAddress, reviewAddress } from '../state/navigation.js';
import { helpOpen } from '../state/workspace.js';

/** @import {ComponentChildren} from 'preact' */

/** @param {{current: 'review' | 'queue', children?: ComponentChildren}} props */
export function Header({ current, children }) {
	const review = lastGroup.value ? reviewAddress(lastGroup.value) : '/review';
	return html`
		<header class="header">
			<a class="header__brand" href="/groups">Touchline</a>
			<nav class="header__nav" aria-label="Pages">
				<a href=${review} aria-current=${current === 'review' ? 'page' : undefined}>Review</a>
				<a href=${queueAddress(dataset.value?.name ?? '', query.value)} aria-current=${current === 'queue' ? 'page' : undefined}>Queue</a>
			</nav>
			${children}
			<button class="header__help" type="button" aria-label="Keys" title="Keys" onClick=${() => { helpOpen.value = true; }}><kbd>?</kbd></button>
		</header>
	`;
}
