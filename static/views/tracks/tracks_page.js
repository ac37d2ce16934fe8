// @ts-check
/** The tracks of a dataset: how well each knows what it has not seen, and the way to make them. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { getTracks, postTracks } from '../../api/tracks.js';
import { useAttempt } from '../../lib/attempt.js';
import { lazy } from '../../lib/lazy.js';
import { count, fixed, plural, sharePercent } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { withValue } from '../../lib/field.js';
import { address, navigate, place } from '../../lib/router.js';
import { isOver, jobToShow } from '../../state/jobs.js';
import { me } from '../../state/me.js';
import { choiceOf, listValues, SHOWN, SORTS, trackAddress } from '../../state/track_list.js';
import { datasetPage } from '../dataset_frame.js';
import { FormError } from '../form_error.js';
import { JobButton } from '../job_button.js';
import { JobProgress } from '../job_progress.js';
import { Loading, Trouble } from '../page_frame.js';
import { useEnded, useRunningJobs } from '../running_jobs.js';

/** @import {ListedTrackJson, TrackJson} from '../../api/tracks.js' */
/** @import {DatasetJson} from '../../api/types.js' */

/** What was said of it, in words. @param {TrackJson} track */
export function verdictText({ verdict, stale, summary }) {
	if (summary.reason) return 'no track';
	return [verdict ?? 'no verdict yet', stale ? 'stale' : ''].filter(Boolean).join(', ');
}

const AssignTracks = lazy(async () => (await import('./assign_tracks.js')).AssignTracks);

/** The other state of the list: the address says it. @param {Record<string, string>} change */
function listAs(change) {
	const values = { ...listValues(place.peek().search), ...change };
	navigate(address(place.peek().path, values), { replace: true });
}

/** Which tracks are listed, and how. @param {{values: Record<string, string>}} props */
function ListTools({ values: { show, mine, batch, sort } }) {
	return html`
		<div class="buttons tracks__tools">
			<label>Show <select class="field" value=${show} onChange=${withValue((text) => listAs({ show: text }))}>${SHOWN.map((one) => html`<option key=${one.show} value=${one.show}>${one.label}</option>`)}</select></label>
			<label>Order <select class="field" value=${sort || SORTS[0].sort} onChange=${withValue((text) => listAs({ sort: text === SORTS[0].sort ? '' : text }))}>${SORTS.map((one) => html`<option key=${one.sort} value=${one.sort}>${one.label}</option>`)}</select></label>
			<button class="button" type="button" aria-pressed=${mine !== ''} onClick=${() => listAs({ mine: mine ? '' : '1' })}>Assigned to me</button>
			${batch ? html`<button class="button" type="button" onClick=${() => listAs({ batch: '' })}>Show tracks of all batches</button>` : null}
		</div>
	`;
}

/** @param {{track: ListedTrackJson, values: Record<string, string>}} props */
function Row({ track, values }) {
	const { summary } = track;
	const known = summary.frames - (summary.states.gap ?? 0);
	const events = Object.values(summary.events).reduce((sum, number) => sum + number, 0);
	return html`
		<tr>
			<th scope="row"><a href=${trackAddress(track.id, values)}>${track.key}</a><small>frames ${track.first} to ${track.last}</small></th>
			<td>${verdictText(track)}${summary.reason ? html`<small>${summary.reason}</small>` : null}</td>
			<td data-numeric="true">${sharePercent(known / summary.frames)}</td>
			<td data-numeric="true">${count(events)}</td>
			<td data-numeric="true">${summary.median_px === null ? '–' : fixed(summary.median_px, 1)}</td>
			<td data-numeric="true">${summary.p95_px === null ? '–' : fixed(summary.p95_px, 1)}</td>
			<td data-numeric="true">${count(summary.contradicted)}</td>
			<td>${track.batches.length ? track.assigned.join(', ') || 'all reviewers' : '–'}</td>
		</tr>
	`;
}

/** @param {{one: DatasetJson}} props */
function Tracks({ one }) {
	const values = listValues(place.value.search);
	const who = me.value?.name ?? 'local';
	const found = useResource((signal) => getTracks(one.name, choiceOf(values, who), signal), [one.id, JSON.stringify(values), who]);
	const [giving, setGiving] = useState(false);
	const { jobs, watch } = useRunningJobs({ dataset: one.name, kind: 'ball' }, ({ kind, dataset }) => kind === 'ball' && dataset === one.name);
	const job = jobToShow(jobs);
	useEnded(jobs, found.reload);
	const { error, busy, attempt } = useAttempt();
	const items = found.value?.items ?? [];
	const chosen = Object.values(values).some(Boolean);
	const open = items.filter((track) => track.verdict === null && !track.summary.reason);
	return html`
		<section class="card" aria-labelledby="tracks-title">
			<h2 id="tracks-title">The ball over time</h2>
			<p class="note">A stretch is a series of groups that follow each other in time: frames of static cameras, or of one shot of a recording. The ball is tracked over each stretch. Its left-out error tells how good a track is: balls are left out in turn and predicted from the others.</p>
			<p class="buttons"><${JobButton} kind="button--primary" busy=${busy || (job !== null && !isOver(job))} act=${() => attempt(postTracks(one.name), watch)}>${items.length || chosen ? 'Recompute the tracks' : 'Track the ball'}<//>${open.length ? html`<button class="button" type="button" data-needs="lead" aria-disabled=${found.waiting} title=${found.waiting ? 'The list is being read' : ''} onClick=${() => { if (!found.waiting) setGiving(true); }}>Assign…</button>` : null}</p>
			${error ? html`<${FormError} error=${error} />` : null}
			${job ? html`<${JobProgress} job=${job} />` : null}
		</section>
		${found.error ? html`<${Trouble} title="The tracks cannot be shown" error=${found.error} retry=${found.reload} />` : null}
		${!found.value && !found.error ? html`<${Loading} what="tracks" />` : null}
		${items.length || chosen ? html`<${ListTools} values=${values} />` : null}
		${giving ? html`<${AssignTracks} dataset=${one.name} id=${one.id} tracks=${open} onClose=${() => setGiving(false)} onDone=${found.reload} />` : null}
		${found.value && chosen && !items.length ? html`<p class="empty-note" role="status">No track matches this filter.</p>` : null}
		${items.length ? html`
			<section class="card card--flush" aria-label="Tracks">
				<div class="table__scroll" tabindex="0" role="region" aria-label="Table of tracks">
					<table class="table">
						<thead><tr><th>${plural(items.length, 'stretch').replace(/hs$/, 'hes')}</th><th>verdict</th><th data-numeric="true">ball known</th><th data-numeric="true">events</th><th data-numeric="true" title="Median error of balls that were left out and predicted from the others">left-out error, px</th><th data-numeric="true">95 %</th><th data-numeric="true" title="Balls that lie too far from the track">contradicting balls</th><th>assigned to</th></tr></thead>
						<tbody>${items.map((track) => html`<${Row} key=${track.id} track=${track} values=${values} />`)}</tbody>
					</table>
				</div>
			</section>` : null}
	`;
}

export const TracksPage = datasetPage('tracks', 'Tracks', Tracks);
