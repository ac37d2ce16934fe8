// @ts-check
/** The newest versions of a dataset, beside its yield. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { getVersions } from '../api/versions.js';
import { plural } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { FreezeDialog } from './freeze_dialog.js';
import { pageAddress } from './dataset_menu.js';
import { verifiedWord } from './verify_report.js';
import { When } from './when.js';

/** @import {VersionJson} from '../api/versions.js' */
/** @import {DatasetJson} from '../api/types.js' */

const SHOWN = 3;

/** @param {{version: VersionJson, address: string}} props */
function Line({ version, address }) {
	return html`
		<div class="version-line">
			<h3><a class="link" href=${address}>${version.name}</a> · frozen <${When} at=${version.created} /></h3>
			<p class="note">${plural(version.counts.groups, 'group')} · sha ${version.hash.slice(0, 8)} · ${version.verified ? html`
				<span data-grade=${version.verified.ok ? 'ok' : 'bad'} title=${version.verified.sentence}>${version.verified.ok ? '✓' : '✗'} ${verifiedWord(version.verified)}</span> <${When} at=${version.verified.at} />` : 'not verified yet'}</p>
			${version.note ? html`<p>${version.note}</p>` : null}
		</div>
	`;
}

/** @param {{one: DatasetJson}} props */
export function VersionCard({ one }) {
	const [freezing, setFreezing] = useState(false);
	const versions = useResource((signal) => getVersions(one.id, signal), [one.id]);
	const items = versions.value?.items ?? [];
	const address = pageAddress(one.name, 'versions');
	return html`
		<section class="card" aria-labelledby="versions-title">
			<h2 id="versions-title">Versions</h2>
			${versions.error ? html`<p class="form__error">${sentenceOf(versions.error)}</p>` : null}
			${versions.value && items.length === 0 ? html`<p class="empty-note">No version yet. A version is a frozen copy of the dataset: it never changes and can be cited.</p>` : null}
			${items.slice(0, SHOWN).map((version) => html`<${Line} key=${version.id} version=${version} address=${address} />`)}
			${items.length > SHOWN ? html`<p><a class="link" href=${address}>All ${items.length} versions</a></p>` : null}
			<p class="version-card__freeze"><button data-needs="lead" class="button button--primary" type="button" onClick=${() => setFreezing(true)}>Freeze a version…</button></p>
			${freezing ? html`<${FreezeDialog} one=${one} taken=${items.map(({ name }) => name)} onClose=${() => setFreezing(false)} onFrozen=${versions.reload} />` : null}
		</section>
	`;
}
