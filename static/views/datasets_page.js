// @ts-check
/** All datasets: how far each one is, and the way to its pages. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { plural } from '../lib/format.js';
import { isTeam } from '../state/me.js';
import { whyNot } from '../state/rights.js';
import { datasets, failure, loadDatasets } from '../state/datasets.js';
import { DATASET_PAGES, pageAddress } from './dataset_menu.js';
import { DeleteDataset } from './delete_dataset.js';
import { ExportDialog } from './export_dialog.js';
import { NoDatasets, mayImport } from './no_datasets.js';
import { Loading, PageFrame, Trouble } from './page_frame.js';
import { ProgressLine } from './progress_card.js';

/** @import {DatasetJson} from '../api/types.js' */

/** @param {{one: DatasetJson, ask: (what: 'delete' | 'export') => void}} props */
function DatasetCard({ one, ask }) {
	const created = new Date(one.created).toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' });
	return html`
		<li>
			<section class="card dataset-card" aria-label=${one.name}>
				<div>
					<h2><a href=${pageAddress(one.name, 'queue')}>${one.name}</a></h2>
					<p class="note">${plural(one.groups, 'group')} · policy ${one.policy.name} · since ${created}</p>
				</div>
				<${ProgressLine} progress=${one} />
				<div class="buttons">
					<button data-needs="review" data-of=${one.name} class="button" type="button" onClick=${() => ask('export')}>Export…</button>
					<button data-needs="administer" data-of=${one.name} class="button button--danger" type="button" onClick=${() => ask('delete')}>Delete…</button>
				</div>
				<nav class="dataset-card__links" aria-label=${`Pages of ${one.name}`}>
					${DATASET_PAGES.map((page) => html`<a key=${page.name} href=${pageAddress(one.name, page.name)}>${page.label}</a>`)}
					${isTeam && whyNot('lead', one.name) === '' ? html`<a href=${pageAddress(one.name, 'statistics')}>Members</a>` : null}
				</nav>
			</section>
		</li>
	`;
}

export function DatasetsPage() {
	const [asked, setAsked] = useState(/** @type {{what: string, one: DatasetJson} | null} */ (null));
	useEffect(() => { loadDatasets(); }, []);
	const all = datasets.value;
	const close = () => setAsked(null);
	return html`
		<${PageFrame}
			current="datasets" title="Datasets" where=${html`<strong>Datasets</strong>`}
			actions=${mayImport() ? html`<a class="button button--primary" href="/import">Import…</a>` : null}
		>
			${failure.value ? html`<${Trouble} title="The datasets cannot be shown" error=${failure.value} retry=${loadDatasets} />` : null}
			${all === null && !failure.value ? html`<${Loading} what="datasets" />` : null}
			${all?.length === 0 ? html`<${NoDatasets} />` : null}
			<ul class="page__list">
				${(all ?? []).map((one) => html`
					<${DatasetCard} key=${one.id} one=${one} ask=${(/** @type {string} */ what) => setAsked({ what, one })} />`)}
			</ul>
			${asked?.what === 'delete' ? html`<${DeleteDataset} one=${asked.one} onClose=${close} />` : null}
			${asked?.what === 'export' ? html`<${ExportDialog} one=${asked.one} onClose=${close} />` : null}
		<//>
	`;
}
