// @ts-check
/** Sets of predictions: uploaded, looked at, accepted, deleted. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { deletePredictions, postPredictions } from '../../api/evaluations.js';
import { sentenceOf } from '../../api/problem.js';
import { useAttempt } from '../../lib/attempt.js';
import { withValue } from '../../lib/field.js';
import { count, plural } from '../../lib/format.js';
import { forgetPredictions } from '../../state/predictions.js';
import { FormDialog } from '../dialog.js';
import { FormError } from '../form_error.js';
import { UploadField } from '../source_choice.js';
import { When } from '../when.js';
import { AcceptPredictions } from './accept_predictions.js';
import { ConfirmButton } from '../confirm_button.js';
import { readSize } from './image_size.js';

/** @import {PredictionSet} from '../../api/evaluations.js' */
/** @import {UploadJson} from '../../api/imports.js' */
/** @import {DatasetJson} from '../../api/types.js' */

const FORMATS = [
	{ name: 'coco', label: 'COCO results', note: 'JSON with boxes and scores', ending: /\.json$/i },
	{ name: 'yolo', label: 'YOLO', note: 'a zip of txt files', ending: /\.(?:zip|txt)$/i },
	{ name: 'csv', label: 'CSV', note: 'as SNv3D.csv, or image,x,y,w,h,score', ending: /\.csv$/i },
	{ name: 'tracks', label: 'Tracks', note: 'ball.csv, or a zip with events.csv', ending: /(?:ball\.csv|tracks[^/]*\.zip)$/i },
];
/** @typedef {{boxes: string | null, cameras: string | null, images: string | null}} Files */

/** @param {{set: PredictionSet}} props */
function Report({ set }) {
	const { report } = set;
	const frames = [...(report.unknown_frames ?? []), ...(report.unknown_cameras ?? [])];
	const problems = report.problems ?? [];
	if (frames.length === 0 && problems.length === 0) return null;
	return html`
		<details class="prediction-set__report">
			<summary>${[set.unknown ? plural(set.unknown, 'unknown frame') : '', problems.length ? plural(problems.length + (report.more_problems ?? 0), 'problem') : ''].filter(Boolean).join(', ') || 'Report'}</summary>
			<ul>
				${frames.map((one) => html`<li key=${one.frame}><span class="mono">${one.frame}</span> <small class="note">${one.problem}</small></li>`)}
				${problems.map((/** @type {any} */ one, /** @type {number} */ index) => html`<li key=${index}><span class="mono">${[one.file, one.record, one.field].filter(Boolean).join(' · ')}</span> <small class="note">${one.problem}</small></li>`)}
			</ul>
		</details>
	`;
}

/** @param {{one: DatasetJson, onClose: () => void, onAdded: () => void}} props */
function UploadDialog({ one, onClose, onAdded }) {
	const [name, setName] = useState('');
	const [format, setFormat] = useState('coco');
	const [files, setFiles] = useState(/** @type {Files} */ ({ boxes: null, cameras: null, images: null }));
	const [state, setState] = useState({ busy: false, error: '' });
	const why = state.busy ? 'Under way' : !name.trim() ? 'Name the predictions' : !files.boxes && !files.cameras ? 'Choose a file first' : '';
	/** @param {FormData} form */
	async function send(form) {
		if (why) return;
		const size = readSize(String(form.get('size') ?? ''), 'Image size');
		const camerasSize = readSize(String(form.get('cameras_size') ?? ''), 'Image size of the cameras');
		const problem = size.problem || camerasSize.problem;
		if (problem) {
			setState({ busy: false, error: problem });
			return;
		}
		setState({ busy: true, error: '' });
		try {
			const category = String(form.get('category') ?? '').trim();
			await postPredictions(one.id, {
				name: name.trim(), format, upload: files.boxes, cameras_upload: format === 'tracks' ? null : files.cameras,
				images_upload: format === 'coco' ? files.images : null, category: category === '' ? null : Number(category),
				size: size.size, cameras_size: camerasSize.size,
			});
			forgetPredictions();
			onAdded();
			onClose();
		} catch (error) {
			setState({ busy: false, error: sentenceOf(error) });
		}
	}
	/** @param {keyof Files} kind */
	const took = (kind) => (/** @type {UploadJson | null} */ sent) => {
		setFiles((before) => ({ ...before, [kind]: sent?.id ?? null }));
		const guessed = kind === 'boxes' && [...FORMATS].reverse().find(({ ending }) => ending.test(sent?.name ?? ''));
		if (guessed) setFormat(guessed.name);
		if (sent && kind !== 'images') setName((before) => before || sent.name.replace(/\.[a-z]+$/i, ''));
	};
	return html`
		<${FormDialog}
			title=${`Upload predictions for ${one.name}`} onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${state.busy ? 'Reading…' : 'Add predictions'}</button>`}
		>
			<fieldset class="choice choice--row">
				<legend>Format</legend>
				${FORMATS.map((known) => html`<label key=${known.name}><input type="radio" name="format" value=${known.name} checked=${format === known.name} onChange=${() => setFormat(known.name)} /><span>${known.label}<small>${known.note}</small></span></label>`)}
			</fieldset>
			<${UploadField} id="prediction-boxes" label=${format === 'tracks' ? 'Tracks of the ball' : 'Ball boxes'} onUploaded=${took('boxes')} />
			${format === 'tracks' ? html`<p class="note">The ball in 3D over time, as an export of tracks has it: frame, time_s, x_m, y_m, z_m, and sigma_m where it is known.</p>` : html`<details>
				<summary class="evaluation__pins">Options for reading the file</summary>
				<div class="form">
					${format === 'coco' ? html`<${UploadField} id="prediction-images" label="COCO images" hint="the document whose image numbers the results use" accept=".json" onUploaded=${took('images')} />` : null}
					<div class="form__row"><label for="prediction-category">Class of the ball</label><input class="field" id="prediction-category" name="category" type="number" min="0" step="1" placeholder="the only one" /></div>
					<div class="form__row"><label for="prediction-size">Image size, where the detector saw resized images</label><input class="field" id="prediction-size" name="size" autocomplete="off" maxlength="20" placeholder="as annotated, or 1280x720" /></div>
					<div class="form__row"><label for="prediction-cameras-size">Image size of the cameras</label><input class="field" id="prediction-cameras-size" name="cameras_size" autocomplete="off" maxlength="20" placeholder="as annotated, or 960x540" /></div>
				</div>
			</details>
			<${UploadField} id="prediction-cameras" label="Predicted cameras (optional)" hint="a zip of SoccerNet camera JSON" onUploaded=${took('cameras')} />`}
			<div class="form__row">
				<label for="prediction-name">Name</label>
				<input class="field" id="prediction-name" maxlength="100" autocomplete="off" value=${name} onInput=${withValue(setName)} />
			</div>
			${state.error ? html`<p class="form__error" role="alert">${state.error}</p>` : null}
		<//>
	`;
}

/** @param {{one: DatasetJson, sets: PredictionSet[], changed: () => void}} props */
export function PredictionSets({ one, sets, changed }) {
	const [asked, setAsked] = useState(/** @type {PredictionSet | 'upload' | null} */ (null));
	const { error, attempt } = useAttempt();
	const close = () => setAsked(null);
	/** @param {PredictionSet} set */
	const remove = (set) => attempt(deletePredictions(set.id), () => { forgetPredictions(); changed(); });
	return html`
		<section class="card" aria-labelledby="sets-title">
			<h2 id="sets-title">Predictions</h2>
			<p><button data-needs="lead" class="button" type="button" onClick=${() => setAsked('upload')}>Upload predictions…</button></p>
			${sets.length === 0 ? html`<p class="empty-note">None yet: COCO results, YOLO files, a CSV, cameras, or tracks.</p>` : null}
			<ul>
				${sets.map((set) => html`
					<li class="prediction-set" key=${set.id}>
						<strong>${set.name}</strong>
						<p class="note">${set.tracks ? `${plural(set.tracks, 'track')} of the ball` : `${count(set.boxes)} ${set.boxes === 1 ? 'box' : 'boxes'} in ${plural(set.frames, 'frame')}`}${set.cameras ? ` · ${plural(set.cameras, 'camera')}` : ''} · ${set.format} · <${When} at=${set.created} /></p>
						<${Report} set=${set} />
						<p class="buttons">
							${set.boxes ? html`<button data-needs="lead" class="button button--small" type="button" onClick=${() => setAsked(set)}>Accept…<span class="hidden-text"> ${set.name}</span></button>` : null}
							<${ConfirmButton} small=${true} label="Delete" question="Delete for good?" what=${set.name} run=${() => remove(set)} />
						</p>
					</li>`)}
			</ul>
			${error ? html`<${FormError} error=${error} />` : null}
			${asked === 'upload' ? html`<${UploadDialog} one=${one} onClose=${close} onAdded=${changed} />` : null}
			${asked && asked !== 'upload' ? html`<${AcceptPredictions} one=${one} set=${asked} onClose=${close} />` : null}
		</section>
	`;
}
