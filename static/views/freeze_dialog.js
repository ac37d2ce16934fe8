// @ts-check
/** Freezing a version: what would enter and what not, then done for good. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { postVersion, previewFreeze } from '../api/versions.js';
import { numberIn, withValue } from '../lib/field.js';
import { count, plural, sharePercent, words } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { follow } from '../state/jobs.js';
import { FormDialog } from './dialog.js';
import { JobProgress } from './job_progress.js';

/** @import {JobJson} from '../api/jobs.js' */
/** @import {FreezePlan, FreezeRequest, SplitRequest} from '../api/versions.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** The first of v1, v2, ... that is free. @param {string[]} taken */
function freeName(taken) {
	let number = taken.length + 1;
	while (taken.includes(`v${number}`)) number += 1;
	return `v${number}`;
}

const GROUPS = /** @type {{name: FreezeRequest['groups'], label: string, note: string}[]} */ ([
	{ name: 'accepted', label: 'Accepted', note: 'by people; groups that fail a gate need a note' },
	{ name: 'passing', label: 'Passing', note: 'all passing, neither rejected nor deferred' },
]);
const SPLITS = /** @type {{kind: SplitRequest['kind'], label: string, note: string}[]} */ ([
	{ kind: 'given', label: 'As imported', note: 'the split that the imported files give' },
	{ kind: 'match', label: 'By match', note: 'random by seed; each match is on one side' },
	{ kind: 'camera', label: 'By camera', note: 'the views of some static cameras are for testing' },
]);

/** @param {{split: SplitRequest, change: (split: SplitRequest) => void}} props */
function SplitFields({ split, change }) {
	return html`
		<fieldset class="choice choice--row">
			<legend>Split into train and test</legend>
			${SPLITS.map(({ kind, label, note }) => html`
				<label key=${kind}>
					<input type="radio" name="split" checked=${split.kind === kind} onChange=${() => change(blank(kind))} />
					<span>${label}<small>${note}</small></span>
				</label>`)}
		</fieldset>
		${split.kind === 'match' ? html`
			<div class="form__columns">
				<div class="form__row"><label for="split-seed">Seed</label><input class="field" id="split-seed" type="number" step="1" min="0" required value=${split.seed ?? ''} onChange=${withValue((text) => change({ ...split, seed: numberIn(text) }))} /></div>
				<div class="form__row"><label for="split-share">Share of matches for testing</label><input class="field" id="split-share" type="number" step="any" min="0.01" max="0.99" required value=${split.test_share ?? ''} onChange=${withValue((text) => change({ ...split, test_share: numberIn(text) }))} /></div>
			</div>` : null}
		${split.kind === 'camera' ? html`
			<div class="form__row"><label for="split-cameras">Test cameras</label><input class="field" id="split-cameras" value=${(split.test_cameras ?? []).join(' ')} onChange=${withValue((text) => change({ ...split, test_cameras: text.split(/[\s,]+/).filter(Boolean) }))} /><small>Names of views, separated by spaces, for example cam1 cam2</small></div>` : null}
	`;
}

/** @param {SplitRequest['kind']} kind @returns {SplitRequest} */
function blank(kind) {
	if (kind === 'match') return { kind, seed: 0, test_share: 0.2 };
	return kind === 'camera' ? { kind, test_cameras: ['cam1', 'cam2'] } : { kind };
}

/**
 * How many groups each split has, and their share: "train 44 (73 %)"; of a split by camera how many views.
 *
 * @param {SplitRequest['kind'] | undefined} kind @param {{[name: string]: number}} groups @param {{[name: string]: number}} views
 */
export function splitTexts(kind, groups, views) {
	const parts = Object.entries(kind === 'camera' ? views : groups).filter(([, n]) => n > 0);
	const all = parts.reduce((sum, [, n]) => sum + n, 0);
	return parts.map(([name, n]) => `${name === 'none' ? 'no split' : name} ${kind === 'camera' ? plural(n, 'view') : count(n)} (${sharePercent(n / all)})`);
}

/** @param {{plan: FreezePlan, split: SplitRequest}} props */
function Plan({ plan, split }) {
	const left = Object.entries(plan.left_out);
	const stale = plan.stale_tracks.length;
	const unknown = plan.unknown_cameras;
	return html`
		<div class="bulk__outcome" role="status">
			<p><strong>${count(plan.groups)}</strong> ${plan.groups === 1 ? 'group is' : 'groups are'} included${plan.groups ? html`: ${splitTexts(split.kind, plan.splits, plan.views).join(', ')}` : ''}.</p>
			${split.kind === 'match' && plan.groups ? html`<p class="note">All groups of a match are in the same split, so the share of groups can differ a little from the share of matches.</p>` : null}
			${unknown.length ? html`<p data-grade="warn">No view of these groups is from ${unknown.length === 1 ? 'the camera' : 'the cameras'} ${unknown.join(', ')}.</p>` : null}
			${plan.unsolved ? html`<p data-grade="warn">${count(plan.unsolved)} ${plan.unsolved === 1 ? 'is' : 'are'} not solved yet.</p>` : null}
			${plan.tracks ? html`<p>${plural(plan.tracks, 'track')} of the ball ${plan.tracks === 1 ? 'is' : 'are'} included.</p>` : null}
			${stale ? html`<p data-grade="warn">${plural(stale, 'accepted track')} ${stale === 1 ? 'stays' : 'stay'} out, as groups have changed since (${plan.stale_tracks.slice(0, 5).join(', ')}${stale > 5 ? ', …' : ''}). Recompute these tracks and accept them first.</p>` : null}
			${left.length ? html`<ul>${left.map(([why, n]) => html`<li key=${why}>${count(n)} ${n === 1 ? 'stays' : 'stay'} out: ${words(why).replace(': ', ', ')}</li>`)}</ul>` : null}
		</div>
	`;
}

/** @param {{ask: FreezeRequest, change: (values: Partial<FreezeRequest>) => void}} props */
function FreezeFields({ ask, change }) {
	return html`
		<div class="form__columns">
			<div class="form__row"><label for="freeze-name">Name</label><input class="field" id="freeze-name" maxlength="100" autocomplete="off" value=${ask.name} onInput=${withValue((name) => change({ name }))} /></div>
			<div class="form__row"><label for="freeze-note">Note</label><input class="field" id="freeze-note" maxlength="2000" autocomplete="off" value=${ask.note} onInput=${withValue((note) => change({ note }))} /></div>
		</div>
		<fieldset class="choice choice--row">
			<legend>Groups</legend>
			${GROUPS.map(({ name, label, note }) => html`
				<label key=${name}>
					<input type="radio" name="groups" checked=${ask.groups === name} onChange=${() => change({ groups: name })} />
					<span>${label}<small>${note}</small></span>
				</label>`)}
		</fieldset>
		<${SplitFields} split=${ask.split} change=${(/** @type {SplitRequest} */ split) => change({ split })} />
		<div class="form__row">
			<label for="freeze-licence">Licence</label>
			<textarea class="field" id="freeze-licence" rows="3" value=${ask.licence} onInput=${withValue((licence) => change({ licence }))}></textarea>
			<small>If empty: the licences of the sources.</small>
		</div>
	`;
}

/** @param {{one: DatasetJson, taken: string[], onClose: () => void, onFrozen: () => void}} props */
export function FreezeDialog({ one, taken, onClose, onFrozen }) {
	const [ask, setAsk] = useState(/** @type {FreezeRequest} */ ({ name: freeName(taken), note: '', licence: '', split: { kind: 'given' }, groups: 'accepted', dry_run: false }));
	const [state, setState] = useState(/** @type {{job: JobJson | null, error: string}} */ ({ job: null, error: '' }));
	const name = ask.name.trim();
	const empty = ask.split.kind === 'match' && (ask.split.seed === null || ask.split.test_share === null);
	const plan = useResource((signal) => (empty ? Promise.resolve(null) : previewFreeze(one.id, { ...ask, name: name || 'v1' }, signal)), [name, ask.groups, JSON.stringify(ask.split)]);
	const { job } = state;
	const busy = job !== null && (job.state === 'running' || job.state === 'waiting');
	const done = job?.state === 'done';
	const why = busy ? 'Under way' : done ? '' : !name ? 'A version needs a name' : empty ? 'A split by match needs a seed and a share' : plan.error ? sentenceOf(plan.error) : plan.value?.groups === 0 ? 'No group would be included' : '';
	async function send() {
		if (done) { onClose(); return; }
		if (why) return;
		try {
			const over = await follow(await postVersion(one.id, { ...ask, name }), (moved) => setState({ job: moved, error: '' }));
			setState({ job: over, error: '' });
			onFrozen();
		} catch (error) {
			setState({ job: null, error: sentenceOf(error) });
		}
	}
	const problem = state.error || (done ? '' : plan.error ? sentenceOf(plan.error) : '');
	return html`
		<${FormDialog}
			wide=${true} title=${`Freeze a version of ${one.name}`} onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${busy ? 'Freezing…' : done ? 'Done' : 'Freeze'}</button>`}
		>
			<${FreezeFields} ask=${ask} change=${(/** @type {Partial<FreezeRequest>} */ values) => setAsk({ ...ask, ...values })} />
			${plan.value && !done ? html`<${Plan} plan=${plan.value} split=${ask.split} />` : null}
			${job ? html`<${JobProgress} job=${job} />` : null}
			${problem ? html`<p class="form__error" role="alert">${problem}</p>` : null}
		<//>
	`;
}
