// @ts-check
/** Every recording, and the way to bring one in. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { listen } from '../../api/events.js';
import { deleteRecording, getRecordings, postRecording } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { withForm, withValue } from '../../lib/field.js';
import { count, plural } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { dataset, datasets, loadDatasets } from '../../state/datasets.js';
import { isOver } from '../../state/jobs.js';
import { lengthText } from '../../state/shots.js';
import { addVideos, videoUploads } from '../../state/video_uploads.js';
import { ConfirmButton } from '../confirm_button.js';
import { FormError } from '../form_error.js';
import { JobProgress } from '../job_progress.js';
import { Empty, Loading, PageFrame, Trouble } from '../page_frame.js';
import { useEnded, useRunningJobs } from '../running_jobs.js';
import { SourceChoice } from '../source_choice.js';
import { When } from '../when.js';
import { VideoField } from './video_uploads.js';

/** @import {ImportSource} from '../../api/imports.js' */
/** @import {JobJson} from '../../api/jobs.js' */
/** @import {RecordingJson} from '../../api/recordings.js' */

/** What is known of it, in words. @param {RecordingJson} one */
export function factsOf({ width, height, fps, variable, interlaced, damaged, seconds, frames, problem }) {
	if (frames === null) return problem ? 'not indexed' : 'not indexed yet';
	return [
		`${width} × ${height}`, `${Number((fps ?? 0).toFixed(3))} frames a second${variable ? ' (variable)' : ''}`,
		lengthText(seconds ?? 0), plural(frames, 'frame'), interlaced ? 'interlaced' : '', damaged ? `${plural(damaged, 'damaged picture')} left out` : '',
	].filter(Boolean).join(' · ');
}

const REMOVES = 'Remove with its shots, tracked cameras, links and followed balls? Its file and its groups stay.';

/** @param {{one: RecordingJson, remove: () => void}} props */
function Row({ one, remove }) {
	return html`
		<tr>
			<th scope="row">${one.indexed ? html`<a href=${`/recordings/${one.id}`}>${one.name}</a>` : one.name}<small>${one.dataset}</small></th>
			<td>${factsOf(one)}${one.problem ? html`<small class="form__error">${one.problem}</small>` : null}</td>
			<td data-numeric="true">${count(one.shots)}</td>
			<td data-numeric="true">${count(one.groups)}</td>
			<td><${When} at=${one.created} /></td>
			<td><span class="table__actions"><${ConfirmButton} small=${true} of=${one.dataset} label="Remove" question=${REMOVES} what=${one.name} run=${remove} /></span></td>
		</tr>
	`;
}

/** @param {{added: () => void}} props */
function AddCard({ added }) {
	const [source, setSource] = useState(/** @type {ImportSource | null} */ (null));
	const { jobs, watch } = useRunningJobs({ kind: 'recording' }, ({ kind }) => kind === 'recording');
	const [typed, setTyped] = useState(/** @type {string | null} */ (null));
	const { error, attempt } = useAttempt();
	const waiting = videoUploads.value.some(({ state, dataset: its }) => its === null && ['queued', 'sending', 'waiting', 'here'].includes(state));
	// Those of uploads stand there.
	const others = jobs.filter(({ id }) => !videoUploads.value.some(({ job }) => job?.id === id));
	const busy = source !== null && others.some((job) => !isOver(job));
	useEnded(others, added);
	const why = busy ? 'A recording is being indexed' : source || waiting ? '' : 'Choose a file first';
	const send = withForm((said) => {
		if (why) return;
		const name = String(said.get('dataset')).trim();
		if (!source) addVideos(name);
		else {
			attempt(postRecording({ dataset: name, source }), watch);
		}
	});
	return html`
		<section class="card" aria-labelledby="add-title">
			<h2 id="add-title">Add a recording</h2>
			<form class="form" onSubmit=${send}>
				<div class="form__row">
					<label for="recording-dataset">Dataset</label>
					<input class="field" id="recording-dataset" name="dataset" list="recording-datasets" maxlength="100" autocomplete="off" required value=${typed ?? dataset.value?.name ?? ''} onInput=${withValue(setTyped)} />
					<datalist id="recording-datasets">${(datasets.value ?? []).map((one) => html`<option key=${one.id} value=${one.name}></option>`)}</datalist>
					<small>A new name makes a new dataset. Groups that you take from the recording go there.</small>
				</div>
				<${SourceChoice} videos=${VideoField} onSource=${setSource} guess=${() => {}} />
				<p class="buttons"><button class="button button--primary" type="submit" data-needs="lead" data-of="" aria-disabled=${why !== ''} title=${why}>Add and find its shots</button></p>
				${error ? html`<${FormError} error=${error} />` : null}
				${others.map((job) => html`
					<${JobProgress} key=${job.id} job=${job} />
					${job.state === 'done' ? html`<p><a class="button" href=${`/recordings/${job.result.recording}`}>Open ${job.result.name}</a></p>` : null}`)}
			</form>
		</section>
	`;
}

export function RecordingsPage() {
	const found = useResource((signal) => getRecordings(signal), []);
	const { error, attempt } = useAttempt();
	useEffect(() => {
		loadDatasets();
		return listen('job', (/** @type {JobJson} */ job) => { if (['recording', 'instants'].includes(job.kind) && isOver(job)) found.reload(); }, found.reload);
	}, []);
	const items = found.value?.items ?? [];
	return html`
		<${PageFrame} current="recordings" title="Recordings" where=${html`<strong>Recordings</strong>`}>
			${found.error ? html`<${Trouble} title="The recordings cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${!found.value && !found.error ? html`<${Loading} what="recordings" />` : null}
			${error ? html`<${FormError} error=${error} card=${true} />` : null}
			${found.value && items.length === 0 ? html`<${Empty} what="recordings" title="No recording yet"><p>A recording is a video of a match. Touchline finds its shots; you choose instants, and each becomes a group to review. The file stays where it is.</p><p>No video at hand? The <a class="link" href="/help/practice">practice</a> has a recording to learn on, and <code>touchline sample-recording film.mp4</code> creates a made-up video of three minutes.</p><//>` : null}
			${items.length ? html`
				<section class="card card--flush" aria-label="Recordings">
					<div class="table__scroll" tabindex="0" role="region" aria-label="Table of recordings">
						<table class="table">
							<thead><tr><th>recording and dataset</th><th>what it is</th><th data-numeric="true">shots</th><th data-numeric="true">groups</th><th>added</th><td></td></tr></thead>
							<tbody>${items.map((one) => html`<${Row} key=${one.id} one=${one} remove=${() => attempt(deleteRecording(one.id), found.reload)} />`)}</tbody>
						</table>
					</div>
				</section>` : null}
			<${AddCard} added=${() => { found.reload(); loadDatasets(); }} />
		<//>
	`;
}
