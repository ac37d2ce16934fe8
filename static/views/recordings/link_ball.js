// @ts-check
/** The times of a replay from the ball: where it is in both shots, and how far its rays miss each other under the map. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { postUpload } from '../../api/imports.js';
import { postBallLink } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { follow, isOver } from '../../state/jobs.js';
import { Chart } from '../chart.js';
import { FormError } from '../form_error.js';
import { JobProgress } from '../job_progress.js';

/** @import {JobJson} from '../../api/jobs.js' */
/** @import {LinkJson} from '../../api/recordings.js' */

/** A file of a form as an upload; null: none was chosen. @param {FormDataEntryValue | null} file */
async function sent(file) {
	return file instanceof File && file.name ? (await postUpload(file, () => {})).id : null;
}

/** @param {{link: LinkJson, dataset: string, reload: () => void}} props */
export function BallCard({ link, dataset, reload }) {
	const [job, setJob] = useState(/** @type {JobJson | null} */ (null));
	const { error, busy, attempt } = useAttempt();
	const runs = busy || (job !== null && !isOver(job));
	/** @param {SubmitEvent} event */
	function find(event) {
		event.preventDefault();
		if (runs) return;
		const said = new FormData(/** @type {HTMLFormElement} */ (event.currentTarget));
		const files = Promise.all([sent(said.get('live')), sent(said.get('replay'))]);
		attempt(files.then(([live, replay]) => postBallLink(link.live.recording, link.id, { live_upload: live, replay_upload: replay })), async (begun) => {
			await follow(begun, setJob);
			reload();
		});
	}
	const { misses } = link.map;
	return html`
		<section class="card linking__ball" aria-label="Ball">
			<h2>Ball</h2>
			<p>Rays of the ball meet where both frames show the same instant. Both shots need tracked cameras, and the ball: marked in groups that were taken from them, or in a file <code>ball.csv</code> (<code>frame,time_s,x,y</code>).</p>
			<form class="linking__files" onSubmit=${find}>
				<label>ball.csv of the live recording <input type="file" name="live" accept=".csv" /></label>
				<label>ball.csv of the replay’s recording <input type="file" name="replay" accept=".csv" /></label>
				<button class="button" type="submit" data-needs="lead" data-of=${dataset} aria-disabled=${runs} title=${runs ? 'It is being looked for' : ''}>Find the times from the ball</button>
			</form>
			${error ? html`<${FormError} error=${error} />` : null}
			${job ? html`<${JobProgress} job=${job} />` : null}
			${misses.length ? html`
				<${Chart}
					name="How far the rays of the ball miss those of the live shot, by frame of the replay" xLabel="frame of the replay" yLabel="miss, m" height=${150}
					x=${misses.map(({ frame }) => frame)} curves=${[{ label: 'miss of the rays', values: misses.map(({ miss_m: miss }) => miss), colour: 'chart-a', points: true }]}
					yRange=${[0, null]} format=${(/** @type {number} */ value) => `${value.toFixed(2)} m`}
				/>` : null}
		</section>
	`;
}
