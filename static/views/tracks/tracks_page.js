// @ts-check
/** The tracks of a dataset: how well each knows what it has not seen, and the way to make them. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { getTracks, postTracks } from '../../api/tracks.js';
import { useAttempt } from '../../lib/attempt.js';
import { count, fixed, plural, sharePercent } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { follow, isOver } from '../../state/jobs.js';
import { datasetPage } from '../dataset_frame.js';
import { FormError } from '../form_error.js';
import { JobButton } from '../job_button.js';
import { JobProgress } from '../job_progress.js';
import { Loading, Trouble } from '../page_frame.js';

/** @import {JobJson} from '../../api/jobs.js' */
/** @import {TrackJson} from '../../api/tracks.js' */
/** @import {DatasetJson} from '../../api/types.js' */

/** What was said of it, in words. @param {TrackJson} track */
export function verdictText({ verdict, stale, summary }) {
	if (summary.reason) return 'no track';
	return [verdict ?? 'not judged', stale ? 'stale' : ''].filter(Boolean).join(', ');
}

/** @param {{track: TrackJson}} props */
function Row({ track }) {
	const { summary } = track;
	const known = summary.frames - (summary.states.gap ?? 0);
	const events = Object.values(summary.events).reduce((sum, number) => sum + number, 0);
	return html`
		<tr>
			<th scope="row"><a href=${`/tracks/${track.id}`}>${track.key}</a><small>frames ${track.first} to ${track.last}</small></th>
			<td>${verdictText(track)}${summary.reason ? html`<small>${summary.reason}</small>` : null}</td>
			<td data-numeric="true">${sharePercent(known / summary.frames)}</td>
			<td data-numeric="true">${count(events)}</td>
			<td data-numeric="true">${summary.median_px === null ? '–' : fixed(summary.median_px, 1)}</td>
			<td data-numeric="true">${summary.p95_px === null ? '–' : fixed(summary.p95_px, 1)}</td>
			<td data-numeric="true">${count(summary.contradicted)}</td>
		</tr>
	`;
}

/** @param {{one: DatasetJson}} props */
function Tracks({ one }) {
	const found = useResource((signal) => getTracks(one.name, signal), [one.id]);
	const [job, setJob] = useState(/** @type {JobJson | null} */ (null));
	const { error, attempt } = useAttempt();
	const items = found.value?.items ?? [];
	const make = () => attempt(postTracks(one.name), async (begun) => {
		await follow(begun, setJob);
		found.reload();
	});
	return html`
		<section class="card" aria-labelledby="tracks-title">
			<h2 id="tracks-title">The ball over time</h2>
			<p class="note">Groups that follow each other in time are a stretch: frames of static cameras, or of a shot of a recording. Over each the ball is tracked. Balls are left out in turn and predicted: that error tells how good a track is.</p>
			<p class="buttons"><${JobButton} kind="button--primary" busy=${job !== null && !isOver(job)} act=${make}>${items.length ? 'Make the tracks again' : 'Track the ball'}<//></p>
			${error ? html`<${FormError} error=${error} />` : null}
			${job ? html`<${JobProgress} job=${job} />` : null}
		</section>
		${found.error ? html`<${Trouble} title="The tracks cannot be shown" error=${found.error} retry=${found.reload} />` : null}
		${!found.value && !found.error ? html`<${Loading} what="tracks" />` : null}
		${items.length ? html`
			<section class="card card--flush" aria-label="Tracks">
				<div class="table__scroll" tabindex="0" role="region" aria-label="Table of tracks">
					<table class="table">
						<thead><tr><th>${plural(items.length, 'stretch').replace(/hs$/, 'hes')}</th><th>verdict</th><th data-numeric="true">ball known</th><th data-numeric="true">events</th><th data-numeric="true" title="Median error of balls that were left out and predicted">left out, px</th><th data-numeric="true">95 %</th><th data-numeric="true" title="Balls that the track does not explain">contradict</th></tr></thead>
						<tbody>${items.map((track) => html`<${Row} key=${track.id} track=${track} />`)}</tbody>
					</table>
				</div>
			</section>` : null}
	`;
}

export const TracksPage = datasetPage('tracks', 'Tracks', Tracks);
