// @ts-check
/** What came of computing a version again: kept with the version, and how far it is while it runs. */

import { html } from 'htm/preact';

import { plural } from '../lib/format.js';
import { isOver } from '../state/jobs.js';
import { JobProgress } from './job_progress.js';
import { When } from './when.js';

/** @import {JobJson} from '../api/jobs.js' */
/** @import {VerificationJson} from '../api/versions.js' */

/** @param {any} value */
const text = (value) => (typeof value === 'string' ? value : JSON.stringify(value));

/** What the last verification says, in a word or two. @param {VerificationJson} found */
export function verifiedWord({ ok, problem }) {
	if (problem) return 'could not be verified';
	return ok ? 'verified' : 'differs from what was frozen';
}

/** @param {{found: VerificationJson}} props */
function Kept({ found }) {
	const { differences, different } = found;
	return html`
		<p data-grade=${found.ok ? 'ok' : 'bad'} role="status"><span aria-hidden="true">${found.ok ? '✓' : '✗'}</span> ${found.sentence}</p>
		<p class="note">Verified <${When} at=${found.at} />${found.actor && found.actor !== 'local' ? ` by ${found.actor}` : ''} with solver ${found.solver_version}. The result is shown until the version is verified again.</p>
		${differences.length ? html`
			<div class="table__scroll" tabindex="0" role="region" aria-label="Differences">
				<table class="table">
					<thead><tr><th>group</th><th>place</th><th>frozen</th><th>now</th></tr></thead>
					<tbody>${differences.map((item, index) => html`
						<tr key=${index}><td>${item.group ?? 'the version'}</td><td class="mono">${item.place}</td><td class="mono">${text(item.frozen)}</td><td class="mono">${text(item.now)}</td></tr>`)}
					</tbody>
				</table>
			</div>
			<p class="note">${plural(different ?? 0, 'difference')} in all${(different ?? 0) > differences.length ? `; the first ${differences.length} are listed` : ''}.</p>` : null}
	`;
}

/** @param {{job: JobJson | null, found: VerificationJson | null}} props found: what is kept from the last time */
export function VerifyReport({ job, found }) {
	const over = job === null || isOver(job);
	const told = job !== null && job.state !== 'done';
	if (!told && !found) return html`<p class="note verify">This version is not verified yet. Verify computes every group again from the frozen annotations and compares all numbers.</p>`;
	return html`
		<div class="verify">
			${told ? html`<${JobProgress} job=${job} />` : null}
			${found && over ? html`<${Kept} found=${found} />` : null}
		</div>
	`;
}
