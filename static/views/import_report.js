// @ts-check
/** What an import did, or would do: counts, and every record that was left out. */

import { html } from 'htm/preact';

import { count, plural, words } from '../lib/format.js';

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

/** @param {{report: Report, dry: boolean}} props */
export function ImportReport({ report, dry }) {
	const numbers = [
		['read', report.read], ['new', report.new], ['changed', report.changed], ['unchanged', report.unchanged], ['findings', report.findings],
	];
	const counts = Object.entries(report.counts ?? {});
	return html`
		<section class="import__report" aria-label=${dry ? 'What would happen' : 'What happened'}>
			<h3>${dry ? 'This is what an import would do; nothing is saved yet' : 'Imported'}</h3>
			<dl class="number-list">${numbers.map(([name, n]) => html`<div key=${name}><dt>${name}</dt><dd>${count(Number(n ?? 0))}</dd></div>`)}</dl>
			${counts.length ? html`<p class="note">${counts.map(([name, n]) => `${count(n)} ${words(name)}`).join(' · ')}</p>` : null}
			${(report.remarks ?? []).map((remark) => html`<p key=${String(remark)} class="note">${String(remark)}</p>`)}
			<${Skipped} report=${report} />
		</section>
	`;
}
