// @ts-check
/** Two groups of the same frames beside each other. */

import { html } from 'htm/preact';
import { useEffect } from 'preact/hooks';

import { getComparison } from '../../api/agreement.js';
import { useResource } from '../../lib/resource.js';
import { page } from '../../lib/router.js';
import { comparison, show } from '../../state/compare.js';
import { reviewAddress } from '../../state/navigation.js';
import { NoticeBar } from '../bars.js';
import { Header } from '../header.js';
import { Loading, Trouble } from '../page_frame.js';
import { CompareWorkspace } from './workspace.js';

/** @import {GroupDocument} from '../../api/types.js' */

/** Whose annotation a group is, as far as its dataset says it. @param {GroupDocument} group */
const nameOf = (group) => `${group.dataset.name} · group ${group.number}`;

/** @param {{groups: GroupDocument[]}} props */
function Links({ groups }) {
	return html`
		<section class="card compare__card" aria-labelledby="compare-open">
			<h2 id="compare-open">Open a group</h2>
			<p class="compare__links">${groups.map((group, place) => html`<a key=${group.id} class="button" href=${reviewAddress(group.id)}>${place + 1} · ${nameOf(group)}</a>`)}</p>
			<p>Solid: drawn by the person named above. Dashed: drawn by the other person. Both pictures zoom and move together.</p>
		</section>
	`;
}

export function ComparePage() {
	const at = page.value.page === 'compare' ? page.value : null;
	const found = useResource(
		(signal) => (at ? getComparison(at.group, at.other, signal) : Promise.resolve(null)), [at?.group, at?.other],
	);
	useEffect(() => {
		if (found.value) show(found.value);
		return () => { comparison.value = null; };
	}, [found.value]);
	const groups = comparison.value?.groups;
	useEffect(() => { document.title = groups ? `${groups[0].label}, compared · Touchline` : 'Touchline'; }, [groups]);
	return html`
		<div class="compare">
			<${Header} current="compare" of=${groups?.[0].dataset.name}><div class="header__middle"><span class="header__where">${groups ? groups[0].label : ''}</span></div><//>
			<div class="bars"><${NoticeBar} /></div>
			${groups ? html`<${CompareWorkspace}
				names=${groups.map(nameOf)} images=${new Map(groups[0].views.map((view) => [view.key, view.image]))}
				chosen=${null} choose=${null}
			><${Links} groups=${groups} /><//>` : html`
				<main class="page__main">${found.error
					? html`<${Trouble} title="The two annotations cannot be shown side by side" error=${found.error} retry=${found.reload} />`
					: html`<${Loading} what="both annotations" />`}</main>`}
		</div>
	`;
}
