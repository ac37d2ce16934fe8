// @ts-check
/** The frame of a page about one dataset: which one, whether it exists, what else it has. */

import { html } from 'htm/preact';
import { useEffect } from 'preact/hooks';

import { pageDataset } from '../lib/router.js';
import { dataset, datasets, failure, loadDatasets, useDataset } from '../state/datasets.js';
import { Loading, PageFrame, Trouble } from './page_frame.js';

/** @import {ComponentChildren, ComponentType} from 'preact' */
/** @import {DatasetJson} from '../api/types.js' */

/**
 * @param {{
 *   current: string, title: string, where?: ComponentChildren, actions?: ComponentChildren,
 *   children: (one: DatasetJson) => ComponentChildren
 * }} props
 */
export function DatasetFrame({ current, title, where, actions, children }) {
	const one = dataset.value;
	const name = pageDataset.value;
	useEffect(() => { loadDatasets(); }, [name]);
	useEffect(() => { if (one) useDataset(one.name); }, [one?.id]);
	const missing = datasets.value !== null && !one;
	return html`
		<${PageFrame}
			current=${current} title=${`${title} of ${name}`}
			where=${html`<strong>${name}</strong> <span class="header__place">${where ?? title}</span>`} actions=${actions}
		>
			${failure.value && !one ? html`<${Trouble} title="The dataset cannot be shown" error=${failure.value} retry=${loadDatasets} />` : null}
			${missing && !failure.value ? html`
				<section class="card empty">
					<h2>There is no dataset “${name}”</h2>
					<p><a class="button" href="/datasets">All datasets</a></p>
				</section>` : null}
			${!one && !missing && !failure.value ? html`<${Loading} what="the dataset" />` : null}
			${one ? children(one) : null}
		<//>
	`;
}

/**
 * A page that shows one dataset, anew for another one.
 *
 * @param {string} current @param {string} title
 * @param {ComponentType<{one: DatasetJson}>} Content
 */
export function datasetPage(current, title, Content) {
	return () => html`
		<${DatasetFrame} current=${current} title=${title}>
			${(/** @type {DatasetJson} */ one) => html`<${Content} key=${one.id} one=${one} />`}
		<//>
	`;
}
