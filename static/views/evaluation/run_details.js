// @ts-check
/** One run: what it pins, its tables, its figures, and the frames behind its numbers. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { deleteEvaluation, getEvaluation } from '../../api/evaluations.js';
import { useAttempt } from '../../lib/attempt.js';
import { count, words } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { FormError } from '../form_error.js';
import { Loading, Trouble } from '../page_frame.js';
import { When } from '../when.js';
import { Comparison } from './comparison.js';
import { ConfirmButton } from '../confirm_button.js';
import { FigureCard } from './figure_card.js';
import { FramesCard } from './frames_card.js';
import { TableCard } from './table_card.js';

/** @import {EvaluationJson, EvaluationRow, FrameQuery} from '../../api/evaluations.js' */
/** @import {VersionJson} from '../../api/versions.js' */

/** What each count of a run means, in the order in which they narrow down. */
const COUNTS = [
	['track_stretches', 'stretches'], ['track_frames', 'frames with a true ball'], ['track_frames_compared', 'with a predicted one'],
	['stretches_not_predicted', 'stretches not predicted'], ['predicted_stretches_unknown', 'unknown predicted stretches'], ['predicted_frames', 'predicted balls'],
	['predicted_frames_without_truth', 'predicted balls without a true one'],
	['groups', 'groups'], ['matches', 'matches'], ['frames', 'frames'], ['judged', 'frames judged'], ['balls', 'with a ball'],
	['with_3d_ball', 'with a 3D ball'], ['without_ball', 'without a ball'], ['detections', 'detections'], ['frames_with_detections', 'frames with detections'],
	['detections_not_judged', 'detections not judged'], ['predicted_cameras', 'predicted cameras'], ['careful_boxes', 'reference boxes'],
	['unknown_predictions_frames', 'unknown frames'], ['accepted_predictions', 'balls accepted from predictions'], ['gone', 'frames deleted since'],
];
/** Those that say nothing when they are zero. */
const OPTIONAL = new Set(['stretches_not_predicted', 'predicted_stretches_unknown', 'predicted_frames_without_truth', 'predicted_cameras', 'careful_boxes', 'accepted_predictions', 'gone', 'unknown_predictions_frames', 'detections_not_judged']);

/** @param {{[name: string]: number}} counts @returns {[string, number][]} */
function countsOf(counts) {
	const known = COUNTS.filter(([name]) => counts[name] !== undefined && !(OPTIONAL.has(name) && counts[name] === 0));
	const others = Object.entries(counts).filter(([name, n]) => n > 0 && !COUNTS.some(([one]) => one === name));
	return [...known.map(([name, label]) => /** @type {[string, number]} */ ([label, counts[name]])), ...others.map(([name, n]) => /** @type {[string, number]} */ ([words(name), n]))];
}

/** @param {unknown} value @returns {string} */
function pinText(value) {
	if (value === null || value === undefined) return '–';
	if (typeof value !== 'object') return String(value);
	return Object.entries(value).map(([name, inner]) => `${words(name)} ${pinText(inner)}`).join(', ');
}

/** @param {{run: EvaluationJson}} props */
function Pins({ run }) {
	return html`
		<details>
			<summary class="evaluation__pins">Reproducibility details</summary>
			<dl class="facts">${Object.entries(run.pins).map(([name, value]) => html`<dt key=${name}>${words(name)}</dt><dd class="mono">${pinText(value)}</dd>`)}</dl>
		</details>
	`;
}

/** @param {{run: EvaluationJson, others: EvaluationRow[], compare: (id: number) => void, remove: () => void, openFrames: () => void}} props */
function Head({ run, others, compare, remove, openFrames }) {
	/** @param {Event} event */
	function choose(event) {
		const select = /** @type {HTMLSelectElement} */ (event.target);
		if (select.value) compare(Number(select.value));
		select.value = '';
	}
	return html`
		<section class="card version" aria-labelledby="run-title">
			<header class="version__head">
				<h2 id="run-title">${run.name}</h2>
				<p class="note">run <${When} at=${run.created} /> by ${run.actor}</p>
				<div class="buttons">
					<select class="field" aria-label="Compare with another run" disabled=${others.length === 0} title=${others.length ? '' : 'There is no other run yet'} onChange=${choose}>
						<option value="">Compare with…</option>${others.map(({ id, name }) => html`<option key=${id} value=${String(id)}>${name}</option>`)}
					</select>
					${run.counts.frames ? html`<button class="button" type="button" onClick=${openFrames}>Frames</button>` : null}
					<${ConfirmButton} label="Delete" question="Delete for good?" what="the run" run=${remove} />
				</div>
			</header>
			<dl class="number-list">${countsOf(run.counts).map(([label, n]) => html`<div key=${label}><dt>${label}</dt><dd>${count(n)}</dd></div>`)}</dl>
			<${Pins} run=${run} />
		</section>
	`;
}

/** @param {{id: number, runs: EvaluationRow[], versions: VersionJson[], changed: () => void}} props */
export function RunDetails({ id, runs, changed }) {
	const found = useResource((signal) => getEvaluation(id, signal), [id]);
	const [frames, setFrames] = useState(/** @type {{query: FrameQuery, title: string} | null} */ (null));
	const [other, setOther] = useState(0);
	const { error, attempt } = useAttempt();
	const opened = useRef(/** @type {HTMLDivElement | null} */ (null));
	useEffect(() => { if (frames || other) opened.current?.scrollIntoView({ block: 'nearest' }); }, [frames?.title, other]);
	if (found.error) return html`<${Trouble} title="The run cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (!found.value) return html`<${Loading} what="the run" />`;
	const run = found.value;
	/** @param {FrameQuery} query @param {string} title */
	const open = (query, title) => setFrames({ query, title });
	const remove = () => attempt(deleteEvaluation(id), changed);
	return html`
		<${Head} run=${run} others=${runs.filter((one) => one.id !== id)} compare=${setOther} remove=${remove} openFrames=${() => open({ sort: 'error_m-desc' }, 'all')} />
		${error ? html`<${FormError} error=${error} card=${true} />` : null}
		<div class="page__list" ref=${opened}>
			${other ? html`<${Comparison} run=${run} other=${other} onClose=${() => setOther(0)} />` : null}
			${frames ? html`<${FramesCard} evaluation=${id} query=${frames.query} title=${frames.title} sort=${(/** @type {string} */ sort) => setFrames({ ...frames, query: { ...frames.query, sort } })} onClose=${() => setFrames(null)} />` : null}
		</div>
		<div class="evaluation__tables">${run.tables.map((table) => html`<${TableCard} key=${table.name} evaluation=${id} table=${table} open=${open} />`)}</div>
		<div class="evaluation__figures">${run.figures.map((name) => html`<${FigureCard} key=${name} evaluation=${id} name=${name} open=${open} />`)}</div>
	`;
}
