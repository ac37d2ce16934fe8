// @ts-check
/** The camera of the view: its numbers with their uncertainty, what is odd, where it comes from. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { chooseCalibration } from '../../api/calibration.js';
import { ApiError } from '../../api/problem.js';
import { fixed } from '../../lib/format.js';
import { groupDocument, rememberEdit, submit, takeOver, unsaved } from '../../state/group.js';
import { announce, complain } from '../../state/notice.js';
import { watchSolving } from '../../state/solving.js';
import { cameraNumbers, oddities } from './camera_numbers.js';

/** @import {SolutionJson, ViewJson} from '../../api/types.js' */
/** @import {ViewPicture} from '../../overlays/scene.js' */

/** @typedef {'given' | 'lines'} Source */

/** @param {ViewJson} view @param {Source} source */
async function choose(view, source) {
	const present = groupDocument.value;
	if (!present || view.station.calibration === source) return;
	try {
		takeOver(await chooseCalibration(present, view, source));
		rememberEdit(present, view.station.shared ? view.station.id : null);
		announce(source === 'given' ? 'The given calibration is used.' : 'The lines are used.');
		if (view.station.shared) watchSolving(present.dataset.name);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`Not changed: ${error.message}`);
	}
}

/** @param {{view: ViewJson}} props */
function SourceChoice({ view }) {
	const [busy, setBusy] = useState(false);
	// The choice builds on the state that the writes before it make.
	const off = busy || unsaved.value > 0 ? 'Wait until the last change is saved' : null;
	const { has_given: given, calibration } = view.station;
	if (!given) return html`<p class="camera-card__source">Computed from the lines; no camera was given.</p>`;
	const sources = /** @type {{source: Source, label: string}[]} */ ([
		{ source: 'given', label: 'Given camera' }, { source: 'lines', label: 'From lines' },
	]);
	return html`
		<div class="segments" role="group" aria-label="Calibration in use">
			${sources.map(({ source, label }) => html`
				<button
					key=${source} class="button" type="button" aria-pressed=${calibration === source} aria-disabled=${off !== null}
					title=${off ?? (source === 'given' ? 'Use the camera that came with the dataset' : 'Find the camera from the annotated lines')}
					onClick=${async () => {
						if (off) return;
						setBusy(true);
						await choose(view, source);
						setBusy(false);
					}}
				>${label}</button>`)}
		</div>
	`;
}

/** What a picture is of which nothing is known but that something was done to it. */
const OPEN = { aspect: 1, shift: [0, 0], sigma: [0.3, 0.4, 0.4] };

/** @param {{view: ViewJson}} props */
function PictureChoice({ view }) {
	const { shared, picture = null, has_given: given, calibration } = view.station;
	// A given camera is what it is, whatever was done to the picture.
	if (shared || (given && calibration === 'given')) return null;
	return html`
		<button
			class="button button--small" type="button" aria-pressed=${picture !== null}
			title=${picture ? 'Treat the picture as unchanged: square pixels, principal point in the middle' : 'Estimate from the lines how the picture was changed'}
			onClick=${() => submit({ kind: 'picture', view: view.key, picture: picture ? null : OPEN })}
		>Stretched or cropped</button>
	`;
}

/** @param {{picture: ViewPicture, solution: SolutionJson | null}} props */
export function CameraCard({ picture, solution }) {
	const { view, solved } = picture;
	const calibration = solved?.calibration ?? null;
	const odd = oddities(solution, view.key, calibration);
	return html`
		<section class="card strip-card camera-card" aria-label="Camera">
			<h2>Camera <span class="card__aside" data-grade=${odd.length ? 'warn' : 'ok'}>${odd.length ? 'uncertain' : '✓ plausible'}</span></h2>
			<div class="editor__scroll" tabindex="0" role="group" aria-label="Camera in numbers">
				<${SourceChoice} view=${view} />
				<${PictureChoice} view=${view} />
				<dl class="camera-card__numbers">
					${cameraNumbers(calibration, view).map(({ name, label, value, digits, unit, sigma, title }) => html`
						<div key=${name}>
							<dt title=${title}>${label}</dt>
							<dd data-number=${name}>${fixed(value, digits, unit)}${sigma === null ? null : html`<small>±${fixed(sigma, digits === 0 ? 0 : Math.max(digits, 2))}</small>`}</dd>
						</div>`)}
				</dl>
				${odd.map((sentence) => html`<p class="camera-card__odd" data-grade="warn">${sentence}</p>`)}
			</div>
		</section>
	`;
}
