// @ts-check
/** The runs of a dataset, and the form that starts one. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { postEvaluation } from '../../api/evaluations.js';
import { sentenceOf } from '../../api/problem.js';
import { withForm } from '../../lib/field.js';
import { count } from '../../lib/format.js';
import { follow, isOver } from '../../state/jobs.js';
import { JobProgress } from '../job_progress.js';
import { When } from '../when.js';
import { number } from './cell.js';

/** @import {EvaluationRow, PredictionSet} from '../../api/evaluations.js' */
/** @import {JobJson} from '../../api/jobs.js' */
/** @import {DatasetJson} from '../../api/types.js' */
/** @import {VersionJson} from '../../api/versions.js' */

const HEADLINES = [
	{ name: 'ap_50', label: 'AP@0.5' }, { name: 'mae_m', label: 'MAE, m' }, { name: 'mae_percent', label: 'MAE, %' }, { name: 'p_2m', label: 'P 2 m' }, { name: 'f1', label: 'events F1' },
];
const LIVE = [{ name: 'passing', label: 'current state: groups that pass' }, { name: 'accepted', label: 'current state: accepted groups' }, { name: 'all', label: 'current state: every group' }];

/** What the form says, as the server wants it. @param {FormData} form */
function bodyOf(form) {
	const text = (/** @type {string} */ name) => String(form.get(name) ?? '');
	const id = (/** @type {string} */ name) => (text(name) ? Number(text(name)) : null);
	const against = text('against');
	const version = /^\d+$/.test(against) ? Number(against) : null;
	return {
		name: text('name').trim(), predictions: id('predictions'), careful: id('careful'), version,
		...(version === null ? { groups: against } : {}), split: text('split').trim() || null, boxes: text('boxes'), min_score: Number(text('min_score')) || 0,
	};
}

/** @param {{sets: PredictionSet[], versions: VersionJson[], why: string, send: (form: FormData) => void}} props */
function RunForm({ sets, versions, why, send }) {
	const choices = sets.map(({ id, name }) => html`<option key=${id} value=${String(id)}>${name}</option>`);
	return html`
		<form class="form run-form" onSubmit=${withForm((said) => { if (!why) send(said); })}>
			<div class="form__row"><label for="run-predictions">Predictions</label><select class="field" id="run-predictions" name="predictions">${choices}<option value="">none: compare reference boxes only</option></select></div>
			<div class="form__row"><label for="run-against">Evaluate against</label><select class="field" id="run-against" name="against">
				${versions.map(({ id, name }) => html`<option key=${id} value=${String(id)}>version ${name}</option>`)}
				${LIVE.map(({ name, label }) => html`<option key=${name} value=${name}>${label}</option>`)}
			</select></div>
			<details>
				<summary>More</summary>
				<div class="form">
					<div class="form__row"><label for="run-name">Name</label><input class="field" id="run-name" name="name" maxlength="100" autocomplete="off" /></div>
					<div class="form__row"><label for="run-split">Split</label><input class="field" id="run-split" name="split" maxlength="50" autocomplete="off" placeholder="all" /></div>
					<div class="form__row"><label for="run-boxes">True box</label><select class="field" id="run-boxes" name="boxes"><option value="optimized">optimised</option><option value="annotated">annotated</option><option value="exact">exact</option></select></div>
					<div class="form__row"><label for="run-careful">Reference boxes, for table 1</label><select class="field" id="run-careful" name="careful"><option value="">none</option>${choices}</select></div>
					<div class="form__row"><label for="run-score">Smallest score that counts for localisation</label><input title="Average precision uses all detections" class="field" id="run-score" name="min_score" type="number" min="0" max="1" step="any" defaultValue="0" /></div>
				</div>
			</details>
			<button data-needs="lead" class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>Evaluate</button>
		</form>
	`;
}

/** @param {{run: EvaluationRow, shown: boolean, version: string, show: () => void}} props */
function RunLine({ run, shown, version, show }) {
	return html`
		<li>
			<button class="run-line" type="button" aria-current=${shown ? 'true' : undefined} onClick=${show}>
				<strong>${run.name}</strong>
				<span class="note">${version} · <${When} at=${run.created} /></span>
				<span class="run-line__numbers">${HEADLINES.filter(({ name }) => run.headline[name]?.value !== null && run.headline[name] !== undefined).map(({ name, label }) => html`<span key=${name}>${label} <b>${number(run.headline[name].value)}</b></span>`)}</span>
			</button>
		</li>
	`;
}

/**
 * @param {{
 *   one: DatasetJson, sets: PredictionSet[], runs: EvaluationRow[], versions: VersionJson[], shown: number,
 *   show: (id: number) => void, changed: (id: number | null) => void
 * }} props
 */
export function Runs({ one, sets, runs, versions, shown, show, changed }) {
	const [state, setState] = useState(/** @type {{job: JobJson | null, error: string}} */ ({ job: null, error: '' }));
	const { job, error } = state;
	const busy = job !== null && !isOver(job);
	const why = busy ? 'A run is under way' : sets.length === 0 ? 'Upload predictions first' : '';
	/** @param {FormData} form */
	async function send(form) {
		setState({ job: null, error: '' });
		try {
			const over = await follow(await postEvaluation(one.id, bodyOf(form)), (moved) => setState({ job: moved, error: '' }));
			setState({ job: over.state === 'done' ? null : over, error: '' });
			if (over.state === 'done') changed(over.result?.evaluation ?? over.result?.id ?? null);
		} catch (problem) {
			setState({ job: null, error: sentenceOf(problem) });
		}
	}
	const versionOf = (/** @type {EvaluationRow} */ run) => (run.version === null ? 'not frozen' : `version ${versions.find(({ id }) => id === run.version)?.name ?? run.version}`);
	return html`
		<section class="card" aria-labelledby="new-run-title">
			<h2 id="new-run-title">New run</h2>
			<${RunForm} key=${[...sets, ...versions].map(({ id, name }) => `${id} ${name}`).join()} sets=${sets} versions=${versions} why=${why} send=${send} />
			${job ? html`<${JobProgress} job=${job} />` : null}
			${error ? html`<p class="form__error" role="alert">${error}</p>` : null}
		</section>
		${runs.length === 0 ? null : html`<section class="card" aria-labelledby="runs-title">
			<h2 id="runs-title">Runs · ${count(runs.length)}</h2>
			<ul class="run-list">${runs.map((run) => html`<${RunLine} key=${run.id} run=${run} shown=${run.id === shown} version=${versionOf(run)} show=${() => show(run.id)} />`)}</ul>
		</section>`}
	`;
}
