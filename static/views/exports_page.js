// @ts-check
/** Every export: under way, ready, failed; fetched or deleted. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { postExport } from '../api/client.js';
import { listen } from '../api/events.js';
import { deleteExport, getExports } from '../api/exports.js';
import { useAttempt } from '../lib/attempt.js';
import { count, counted, plural, words } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { dataset, loadDatasets } from '../state/datasets.js';
import { isOver } from '../state/jobs.js';
import { ConfirmButton } from './confirm_button.js';
import { ExportDialog } from './export_dialog.js';
import { FormError } from './form_error.js';
import { Empty, Loading, PageFrame, Trouble } from './page_frame.js';
import { sizeText } from './source_choice.js';
import { When } from './when.js';

/** @import {ExportRow} from '../api/exports.js' */
/** @import {JobJson} from '../api/jobs.js' */

/** @param {string} at */
const dayText = (at) => new Date(at).toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' });

/** What is in it, in words. @param {ExportRow} row */
function contents({ request, counts }) {
	const what = request.version ? `version ${request.version}` : request.all ? 'all groups' : 'accepted groups';
	const numbers = Object.entries(counts ?? {}).map(([name, n]) => counted(n, name));
	return [what, `${request.boxes} boxes`, ...numbers].join(' · ');
}

/** @param {{row: ExportRow, remove: () => void, again: () => void}} props */
function Row({ row, remove, again }) {
	const left = Object.entries(row.left_out ?? {});
	const open = row.status === 'waiting' || row.status === 'running';
	return html`
		<tr>
			<th scope="row">${row.request.dataset}<small>${row.request.format}</small></th>
			<td>${contents(row)}
				${left.length ? html`<small>left out: ${left.map(([why, n]) => `${count(n)} ${words(why)}`).join(', ')}</small>` : null}
				${row.incomplete ? html`<small>${row.incomplete}</small>` : null}
				${row.missing_images?.length ? html`<small>${plural(row.missing_images.length, 'frame')} missing</small>` : null}
				${row.error ? html`<small class="form__error">${row.error}</small>` : null}</td>
			<td>${row.incomplete && row.status === 'ready' ? html`<span class="pill" data-status="deferred" title=${row.incomplete}>incomplete</span>` : html`<span class="pill" data-state=${row.status}>${row.status}</span>`}${row.expires ? html`<small>until ${dayText(row.expires)}</small>` : null}</td>
			<td data-numeric="true">${row.bytes === null ? '–' : sizeText(row.bytes)}</td>
			<td><${When} at=${row.created} /></td>
			<td><span class="table__actions">
				${row.content ? html`<a class="button button--small" href=${row.content} download>Download<span class="hidden-text"> export ${row.id}</span></a>` : null}
				${row.status === 'expired' ? html`<button class="button button--small" type="button" data-needs="review" data-of=${row.request.dataset} title="The file was deleted after some days. Export the dataset again, in its present state" onClick=${again}>Export again<span class="hidden-text">: export ${row.id}</span></button>` : null}
				${open ? html`<a class="button button--small" href="/jobs">Job<span class="hidden-text"> of export ${row.id}</span></a>` : ['ready', 'failed', 'cancelled'].includes(row.status) ? html`<${ConfirmButton} small=${true} of=${row.request.dataset} label="Delete" question="Delete for good?" what=${`export ${row.id}`} run=${remove} />` : null}
			</span></td>
		</tr>
	`;
}

export function ExportsPage() {
	const exports = useResource((signal) => getExports({ limit: 100 }, signal), []);
	const [asking, setAsking] = useState(false);
	const { error, attempt } = useAttempt();
	const one = dataset.value;
	useEffect(() => {
		loadDatasets();
		return listen('job', (/** @type {JobJson} */ job) => { if (job.kind === 'export' && (isOver(job) || job.done === 0)) exports.reload(); }, () => exports.reload());
	}, []);
	/** @param {ExportRow} row */
	const remove = (row) => attempt(deleteExport(row.id), exports.reload);
	/** @param {ExportRow} row */
	const again = (row) => attempt(postExport(row.request), exports.reload);
	const items = exports.value?.items ?? [];
	return html`
		<${PageFrame}
			current="exports" title="Exports" where=${html`<strong>Exports</strong>`}
			actions=${one ? html`<button data-needs="review" class="button button--primary" type="button" onClick=${() => setAsking(true)}>Export ${one.name}…</button>` : null}
		>
			${exports.error ? html`<${Trouble} title="The exports cannot be shown" error=${exports.error} retry=${exports.reload} />` : null}
			${!exports.value && !exports.error ? html`<${Loading} what="exports" />` : null}
			${error ? html`<${FormError} error=${error} card=${true} />` : null}
			${exports.value && items.length === 0 ? html`<${Empty} what="exports" title="No export yet"><p>An export is a zip file of a dataset in a format of your choice. Its manifest lists the contents, the policy and the digest of each file.</p><//>` : null}
			${items.length ? html`
				<section class="card card--flush" aria-label="Exports">
					<table class="table">
						<thead><tr><th>dataset and format</th><th>what is in it</th><th>state</th><th data-numeric="true">size</th><th>made</th><td></td></tr></thead>
						<tbody>${items.map((row) => html`<${Row} key=${row.id} row=${row} remove=${() => remove(row)} again=${() => again(row)} />`)}</tbody>
					</table>
				</section>` : null}
			${asking && one ? html`<${ExportDialog} one=${one} onClose=${() => { setAsking(false); exports.reload(); }} />` : null}
		<//>
	`;
}
