// @ts-check
/** Videos that are sent: chosen or dropped, each with how far it is. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { chosenFiles, isVideo } from '../../lib/local_files.js';
import { plural } from '../../lib/format.js';
import { dropVideo, findUploads, sendAgain, sendVideos, uploadDays, videoUploads } from '../../state/video_uploads.js';
import { JobProgress } from '../job_progress.js';
import { sizeText, UploadRoom } from '../source_choice.js';

/** @import {PathFile} from '../../lib/zip_packing.js' */
/** @import {VideoUpload} from '../../state/video_uploads.js' */

/** What a state is called, and the tone of its pill. @type {{[state in VideoUpload['state']]: [string, string]}} */
const STATES = {
	queued: ['queued', 'waiting'], sending: ['sending', 'running'], waiting: ['waiting', 'waiting'], half: ['incomplete', 'cancelled'],
	here: ['uploaded', 'ready'], refused: ['failed', 'failed'], added: ['uploaded', 'ready'],
};

/** @param {VideoUpload} one @returns {string} */
function sentence({ state, bytes, size, error, dataset, left }) {
	const share = `${Math.floor((100 * bytes) / size)} % of ${sizeText(size)}`;
	const then = dataset ? ` Then it becomes a recording of ${dataset}.` : '';
	if (state === 'refused') return error;
	if (state === 'half') return `${share} is uploaded. Choose the file again to continue; otherwise it is deleted ${plural(uploadDays.value, 'day')} after the last part arrived.`;
	if (state === 'waiting') return `${error || 'The server cannot be reached.'} ${share} is uploaded; it continues by itself.${then}`;
	if (state === 'sending') return `${share}${left === null ? '' : `, ${left < 90 ? 'about a minute' : `${Math.round(left / 60)} minutes`} left`}.${then}`;
	if (state === 'queued') return `${sizeText(size)}.${then}`;
	return `${sizeText(size)}.`;
}

/** @param {{one: VideoUpload}} props */
function Row({ one }) {
	const { name, state, bytes, size, job } = one;
	const [word, tone] = STATES[state];
	const percent = Math.floor((100 * bytes) / size);
	const isOver = state === 'added';
	return html`
		<li class="job">
			<div class="job__line" role="status">
				<span class="pill" data-state=${tone}>${word}</span>
				<strong>${name}</strong>
				<span class=${state === 'refused' ? 'job__sentence form__error' : 'job__sentence'}>${sentence(one)}</span>
				${state === 'refused' ? html`<button class="button button--small" type="button" onClick=${() => sendAgain(one)}>Try again<span class="hidden-text"> with ${name}</span></button>` : null}
				${isOver ? null : html`<button class="button button--small" type="button" title="Deletes the part that is uploaded" onClick=${() => dropVideo(one)}>Remove<span class="hidden-text"> the upload of ${name}</span></button>`}
			</div>
			${state === 'here' || isOver ? null : html`<div class="meter" role="progressbar" aria-label=${`Upload of ${name}`} aria-valuemin="0" aria-valuemax="100" aria-valuenow=${percent}><span style=${{ width: `${percent}%` }}></span></div>`}
			${job ? html`<${JobProgress} job=${job} />` : null}
			${job?.state === 'done' ? html`<p><a class="button" href=${`/recordings/${job.result.recording}`}>Open ${job.result.name}</a></p>` : null}
		</li>
	`;
}

/** Any number of videos, chosen here or dropped; they are sent at once. @param {{dropped: Promise<PathFile[]> | null, over: boolean}} props */
export function VideoField({ dropped, over }) {
	const [error, setError] = useState('');
	/** @param {PathFile[]} files */
	function take(files) {
		const [strange] = files.filter(({ path }) => !isVideo(path));
		setError(strange ? `${strange.path} is not a video: a recording is made of a video file.` : '');
		if (!strange) sendVideos(files.map(({ file }) => file));
	}
	useEffect(() => { dropped?.then(take); }, [dropped]);
	useEffect(() => { findUploads().catch(() => {}); }, []);
	const uploads = videoUploads.value;
	/** @param {Event} event */
	function choose(event) {
		const input = /** @type {HTMLInputElement} */ (event.target);
		take(chosenFiles(input.files ?? []));
		// So that the same file may be chosen once more.
		input.value = '';
	}
	return html`
		<div class="form__row import__drop" data-over=${over}>
			<label for="import-file">Videos</label>
			<input class="field" id="import-file" type="file" multiple accept="video/*,.mkv,.ts,.mts,.m2ts" onChange=${choose} />
			<small>Or drop them anywhere on this page. They are uploaded one after the other. After a break of the network or the server they continue by themselves; if you close this page, choose them again to continue.</small>
			${error ? html`<p class="form__error" role="alert">${error}</p>` : null}
			${uploads.length ? html`<ul class="uploads" aria-label="Uploads">${uploads.map((one) => html`<${Row} key=${one.key} one=${one} />`)}</ul>` : null}
			<${UploadRoom} sent=${uploads.filter(({ state }) => state === 'here').length} />
		</div>
	`;
}
