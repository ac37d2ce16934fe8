// @ts-check
/** Frozen versions: listed, compared, verified, exported. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { getVersions, manifestAddress, verifyVersion } from '../api/versions.js';
import { count, plural, sharePercent } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { follow, jobToShow } from '../state/jobs.js';
import { datasetPage } from './dataset_frame.js';
import { ExportDialog } from './export_dialog.js';
import { FreezeDialog, splitTexts } from './freeze_dialog.js';
import { JobProgress } from './job_progress.js';
import { Loading, Trouble } from './page_frame.js';
import { useEnded, useRunningJobs } from './running_jobs.js';
import { VerifyReport } from './verify_report.js';
import { VersionDiff } from './version_diff.js';
import { When } from './when.js';

/** @import {JobJson} from '../api/jobs.js' */
/** @import {VersionJson} from '../api/versions.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** @param {any} split @returns {string} */
function splitText(split) {
	if (split?.kind === 'match') return `by match, seed ${split.seed}, ${sharePercent(split.test_share)} of the matches test`;
	if (split?.kind === 'camera') return `by camera, ${split.test_cameras.join(' ')} test`;
	return 'as imported';
}

/** @param {{version: VersionJson}} props */
function Facts({ version }) {
	const { counts } = version;
	const parts = Object.entries(counts.splits ?? {});
	const of = (/** @type {'groups' | 'views'} */ what) => Object.fromEntries(parts.map(([name, part]) => [name, /** @type {any} */ (part)[what]]));
	const splits = splitTexts(version.split?.kind, of('groups'), of('views'));
	return html`
		<dl class="facts">
			<dt>Hash</dt><dd class="mono">${version.hash}</dd>
			<dt>Groups</dt><dd>${count(counts.groups)}${splits.length ? ` (${splits.join(', ')})` : ''} · ${plural(counts.views ?? 0, 'view')} · ${plural(counts.balls ?? 0, 'ball')}${counts.tracks ? ` · ${plural(counts.tracks, 'track')}` : ''}${counts.overrides ? ` · ${count(counts.overrides)} accepted although a gate fails` : ''}</dd>
			<dt>Split</dt><dd>${splitText(version.split)}</dd>
			<dt>Policy</dt><dd>${version.policy?.name ?? ''} <span class="mono">${version.policy?.hash ?? ''}</span></dd>
			<dt>Computed by</dt><dd>solver ${version.solver_version}, Touchline ${version.software_version}</dd>
		</dl>
	`;
}

/**
 * @param {{
 *   version: VersionJson, others: VersionJson[], job: JobJson | null, verify: () => void,
 *   compare: (older: VersionJson) => void, ask: () => void
 * }} props
 */
function VersionSection({ version, others, job, verify, compare, ask }) {
	/** @param {Event} event */
	function choose(event) {
		const select = /** @type {HTMLSelectElement} */ (event.target);
		const older = others.find(({ id }) => String(id) === select.value);
		select.value = '';
		if (older) compare(older);
	}
	return html`
		<li>
			<section class="card version" aria-labelledby=${`version-${version.id}`}>
				<header class="version__head">
					<h2 id=${`version-${version.id}`}>${version.name}</h2>
					<p class="note">frozen <${When} at=${version.created} />${version.actor ? ` by ${version.actor}` : ''}</p>
					<div class="buttons">
						<button data-needs="lead" class="button" type="button" onClick=${verify} title="Compute every group again and compare it with what was frozen">Verify</button>
						<select class="field" aria-label=${`Compare ${version.name} with`} disabled=${others.length === 0} title=${others.length ? '' : 'There is no other version yet'} onChange=${choose}>
							<option value="">Compare with…</option>
							${others.map(({ id, name }) => html`<option key=${id} value=${String(id)}>${name}</option>`)}
						</select>
						<a class="button" href=${manifestAddress(version.id)} target="_blank" rel="noopener">Manifest</a>
						<button data-needs="review" class="button" type="button" onClick=${ask}>Export…</button>
					</div>
				</header>
				${version.note ? html`<p>${version.note}</p>` : null}
				<${Facts} version=${version} />
				<${VerifyReport} job=${job} found=${version.verified ?? null} />
			</section>
		</li>
	`;
}

/** Verifications under way or done, by version. @param {() => void} kept called when a result is kept with its version */
function useVerify(kept) {
	const [jobs, setJobs] = useState(/** @type {{[id: number]: JobJson}} */ ({}));
	const [problem, setProblem] = useState('');
	/** @param {VersionJson} version */
	async function verify(version) {
		setProblem('');
		try {
			await follow(await verifyVersion(version.id), (job) => setJobs((before) => ({ ...before, [version.id]: job })));
			kept();
		} catch (error) {
			setProblem(sentenceOf(error));
		}
	}
	return { jobs, problem, verify };
}

/** @param {{one: DatasetJson}} props */
function VersionsOf({ one }) {
	const versions = useResource((signal) => getVersions(one.id, signal), [one.id]);
	const freezing = useRunningJobs({ dataset: one.name, kind: 'freeze' }, ({ kind, dataset }) => kind === 'freeze' && dataset === one.name).jobs;
	const freeze = jobToShow(freezing);
	useEnded(freezing, versions.reload);
	const { jobs, problem, verify } = useVerify(versions.reload);
	const [diff, setDiff] = useState(/** @type {{older: VersionJson, newer: VersionJson} | null} */ (null));
	const [asked, setAsked] = useState(/** @type {VersionJson | 'freeze' | null} */ (null));
	if (versions.error) return html`<${Trouble} title="The versions cannot be shown" error=${versions.error} retry=${versions.reload} />`;
	if (!versions.value) return html`<${Loading} what="versions" />`;
	const { items } = versions.value;
	const close = () => setAsked(null);
	return html`
		<div class="page__title">
			<p>A version never changes, and its hash identifies its content. Verify computes every group again and compares it with what was frozen.</p>
			<button data-needs="lead" class="button button--primary" type="button" onClick=${() => setAsked('freeze')}>Freeze a version…</button>
		</div>
		${problem ? html`<p class="card form__error" role="alert">${problem}</p>` : null}
		${freeze && freeze.state !== 'done' && asked !== 'freeze' ? html`<section class="card" aria-label="Freezing"><${JobProgress} job=${freeze} /></section>` : null}
		${diff ? html`<${VersionDiff} ...${diff} dataset=${one.name} onClose=${() => setDiff(null)} />` : null}
		${items.length === 0 ? html`
			<section class="card empty"><h2>Nothing is frozen yet</h2><p>${count(one.accepted)} of ${plural(one.groups, 'group')} accepted so far. A version contains the accepted groups, or all groups that pass.</p></section>` : null}
		<ul class="page__list">
			${items.map((version) => html`
				<${VersionSection}
					key=${version.id} version=${version} others=${items.filter(({ id }) => id !== version.id)} job=${jobs[version.id] ?? null}
					verify=${() => verify(version)} ask=${() => setAsked(version)}
					compare=${(/** @type {VersionJson} */ other) => setDiff(other.id < version.id ? { older: other, newer: version } : { older: version, newer: other })}
				/>`)}
		</ul>
		${asked === 'freeze' ? html`<${FreezeDialog} one=${one} taken=${items.map(({ name }) => name)} onClose=${close} onFrozen=${versions.reload} />` : null}
		${asked && asked !== 'freeze' ? html`<${ExportDialog} one=${one} version=${asked} onClose=${close} />` : null}
	`;
}

export const VersionsPage = datasetPage('versions', 'Versions', VersionsOf);
