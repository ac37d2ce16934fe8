// @ts-check
/** What an import did, or would do: counts, and every record that was left out. */

import { html } from 'htm/preact';

import { count, counted, plural } from '../lib/format.js';
import { queueAddress } from '../state/navigation.js';
import { pageAddress } from './dataset_menu.js';

/** @import {ImportReport as Report} from '../api/imports.js' */

/** @param {{report: Report}} props */
function Skipped({ report }) {
	const { skipped, more_skipped: more = 0 } = report;
	if (skipped.length === 0) return html`<p class="note">No record was left out.</p>`;
	return html`
		<h3>${plural(skipped.length + more, 'record')} ${skipped.length + more === 1 ? 'is' : 'are'} left out</h3>
		<div class="table__scroll import__skipped" tabindex="0" role="region" aria-label="Records that are left out">
			<table class="table">
				<thead><tr><th>file</th><th>record</th><th>field</th><th>problem</th></tr></thead>
				<tbody>${skipped.map((one, index) => html`
					<tr key=${index}><td class="mono">${one.file}</td><td class="mono">${one.record ?? ''}</td><td class="mono">${one.field ?? ''}</td><td>${one.problem}</td></tr>`)}
				</tbody>
			</table>
		</div>
		${more ? html`<p class="note">and ${count(more)} more</p>` : null}
	`;
}

/** What is said over the numbers, by what came of the import. @param {string | undefined} outcome @param {boolean} dry */
function heading(outcome, dry) {
	if (outcome === 'nothing') return dry ? 'No record could be read: an import would add nothing' : 'Nothing was imported';
	if (outcome === 'partial') return dry ? 'Some records would be left out; nothing is saved yet' : 'Imported, but some records were left out';
	return dry ? 'This is what an import would do; nothing is saved yet' : 'Imported';
}

/** Groups that nobody can look at, and the way to them. @param {{report: Report, dry: boolean, dataset: string}} props */
function WithoutPicture({ report, dry, dataset }) {
	const groups = report.without_picture ?? 0;
	if (!groups) return null;
	const which = `${plural(groups, 'group')} ${groups === 1 ? 'has' : 'have'} no picture in any view`;
	return html`
		<p data-grade="warn">
			${dry ? which : html`<a href=${queueAddress(dataset, 'pictures:none')}>${which}</a>`}.
			Reviewers cannot see ${groups === 1 ? 'it' : 'them'}, so accepting ${groups === 1 ? 'it' : 'one'} needs a note. Check that the frames (for SoccerNet, Frames-v3.zip) are beside the labels.
		</p>
	`;
}

/** @param {{report: Report, dry: boolean, dataset: string}} props */
export function ImportReport({ report, dry, dataset }) {
	const { outcome } = report;
	const groups = report.new + report.changed + report.unchanged;
	const numbers = [
		['groups', groups], ['new', report.new], ['changed', report.changed], ['unchanged', report.unchanged], ['findings', report.findings],
		['left out', report.skipped.length + (report.more_skipped ?? 0)], ['without picture', report.without_picture],
	];
	const counts = Object.entries(report.counts ?? {});
	const grade = outcome === 'nothing' ? 'bad' : outcome === 'partial' ? 'warn' : 'ok';
	return html`
		<section class="import__report" aria-label=${dry ? 'What would happen' : 'What happened'}>
			<h3 data-grade=${grade}>${heading(outcome, dry)}</h3>
			<dl class="number-list">${numbers.map(([name, n]) => html`<div key=${name}><dt>${name}</dt><dd>${count(Number(n ?? 0))}</dd></div>`)}</dl>
			<p class="note">${plural(report.read, 'record')} in the files</p>
			${counts.length ? html`<p class="note">${counts.map(([name, n]) => counted(n, name)).join(' · ')}</p>` : null}
			<${WithoutPicture} report=${report} dry=${dry} dataset=${dataset} />
			${report.paint_job ? html`
				<p>Cameras are found from the lines first. Then <a href=${pageAddress(dataset, 'statistics')}>the paint of the pictures</a> is read, which places them more exactly.</p>` : null}
			${report.proposals_job ? html`
				<p>Now <a href=${pageAddress(dataset, 'statistics')}>cameras are proposed</a> from the paint of the pictures. Open a group to accept its camera, draw its lines and its ball.</p>` : null}
			${report.rig_job ? html`
				<p>Given cameras of a rig often contradict each other by some pixels. An adjustment to lines and balls is <a href="/jobs">being proposed</a>; ${html`<code>touchline rig --dataset ${dataset} --accept cameras</code>`} accepts it. Nothing changes before that.</p>` : null}
			${(report.remarks ?? []).map((remark) => html`<p key=${String(remark)} class="note">${String(remark)}</p>`)}
			<${Skipped} report=${report} />
		</section>
	`;
}
