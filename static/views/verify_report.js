// @ts-check
/** What came of computing a version again. */

import { html } from 'htm/preact';

import { plural } from '../lib/format.js';
import { JobProgress } from './job_progress.js';

/** @import {JobJson} from '../api/jobs.js' */

/** @param {any} value */
const text = (value) => (typeof value === 'string' ? value : JSON.stringify(value));

/** @param {{job: JobJson}} props */
export function VerifyReport({ job }) {
	const report = job.state === 'done' ? job.result : null;
	return html`
		<div class="verify">
			<${JobProgress} job=${job} />
			${report ? html`<p data-grade=${report.ok ? 'ok' : 'bad'} role="status">${report.ok ? '✓' : '✗'} ${report.sentence}</p>` : null}
			${report?.differences?.length ? html`
				<div class="table__scroll" tabindex="0" role="region" aria-label="Differences">
					<table class="table">
						<thead><tr><th>group</th><th>place</th><th>frozen</th><th>now</th></tr></thead>
						<tbody>${report.differences.slice(0, 40).map((/** @type {any} */ item, /** @type {number} */ index) => html`
							<tr key=${index}><td>${item.group ?? 'the version'}</td><td class="mono">${item.place}</td><td class="mono">${text(item.frozen)}</td><td class="mono">${text(item.now)}</td></tr>`)}
						</tbody>
					</table>
				</div>
				<p class="note">${plural(report.different, 'difference')} in all.</p>` : null}
		</div>
	`;
}
