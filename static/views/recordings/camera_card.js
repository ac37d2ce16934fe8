// @ts-check
/** The cameras of a shot: tracked, how well, and mended where they are wrong. */

import { html } from 'htm/preact';

import { camerasFile } from '../../api/cameras.js';
import { count, plural } from '../../lib/format.js';
import { pitchSize, shownSize } from '../../lib/pitch_size.js';
import { FormError } from '../form_error.js';
import { JobProgress } from '../job_progress.js';
import { TOGETHER } from './camera_state.js';

/** @import {CameraSummary, ShotCamerasJson} from '../../api/cameras.js' */
/** @import {RecordingJson} from '../../api/recordings.js' */
/** @import {Cameras} from './camera_state.js' */

const FILES = [['soccernet', 'SoccerNet JSON'], ['npz', 'npz'], ['opentrackio', 'OpenTrackIO']];
/** @param {CameraSummary} summary */
const worstOf = ({ worst_frame: frame, worst_px: error }) => (frame === null || error === null ? '–' : `${error.toFixed(2)} px (frame ${frame})`);

/** What became of the frames, beside what it was before. @param {{stretch: ShotCamerasJson, old: boolean}} props */
function Counts({ stretch: { summary, before }, old }) {
	const names = /** @type {const} */ (['tracked', 'bridged', 'lost']);
	return html`
		<table class="table camera__counts">
			<thead><tr><th>frames</th>${before ? html`<th data-numeric="true" aria-current=${old ? 'true' : undefined}>before</th>` : null}<th data-numeric="true" aria-current=${before && !old ? 'true' : undefined}>${before ? 'now' : ''}</th></tr></thead>
			<tbody>
				${names.map((name) => html`
					<tr key=${name}><th scope="row"><span class="camera__letter" data-outcome=${name[0].toUpperCase()} aria-hidden="true">${name[0].toUpperCase()}</span>${name}</th>
						${before ? html`<td data-numeric="true">${count(before[name])}</td>` : null}<td data-numeric="true">${count(summary[name])}</td></tr>`)}
				<tr><th scope="row">worst error</th>${before ? html`<td data-numeric="true">${worstOf(before)}</td>` : null}<td data-numeric="true">${worstOf(summary)}</td></tr>
			</tbody>
		</table>
	`;
}

/** @param {{one: RecordingJson, cameras: Cameras}} props */
export function CameraCard({ one, cameras }) {
	const { stretch, frames, job, error, busy, before, missing } = cameras;
	const fresh = stretch ? stretch.drawn.filter((frame) => !stretch.summary.annotated.includes(frame)) : [];
	const useless = stretch?.summary.unusable ?? [];
	const shown = stretch?.summary.pitch;
	const noGroup = one.groups ? '' : 'The match has no group yet: choose a frame (I) and make a group of it';
	return html`
		<section class="card camera" aria-label="Cameras">
			<h2>Cameras${stretch ? html`<span class="card__aside">frames ${stretch.first} to ${stretch.last}</span>` : null}</h2>
			${stretch ? html`<${Counts} stretch=${stretch} old=${before} />` : html`<p>Tracking finds a camera for each frame of this shot from the painted lines. Groups made of these frames then have a camera.</p>`}
			${error ? html`<${FormError} error=${error} />` : null}
			${job && job.state !== 'done' ? html`<${JobProgress} job=${job} />` : null}
			${stretch?.stale ? html`<p class="form__error">The video file has changed since then: track the shot again.</p>` : null}
			${fresh.length ? html`<p role="status">Lines were drawn in ${fresh.length === 1 ? `frame ${fresh[0]}` : plural(fresh.length, 'frame')} after the shot was tracked. Track again to use them.</p>` : null}
			${useless.length ? html`<p class="form__error">Frame ${useless.join(', ')} has too few lines for a camera, and was not used.</p>` : null}
			${shown?.other ? html`
				<p role="status">The frames of this shot show another pitch size than the match has${frames ? ` (${pitchSize({ length: frames.pitch[0], width: frames.pitch[1] })})` : ''}: ${shownSize({ ...shown, length_sigma_m: shown.sigma.length, width_sigma_m: shown.sigma.width })}. If you use it, the groups of the match are solved again and the shot is tracked again.${noGroup ? ` ${noGroup}.` : ''}</p>
				<p><button class="button" type="button" data-needs="lead" data-of=${one.dataset} aria-disabled=${busy !== '' || noGroup !== ''} title=${busy || noGroup || 'The page Statistics can restore the previous size'} onClick=${noGroup ? undefined : cameras.takePitch}>Use ${pitchSize(shown.other)} for this match</button></p>` : null}
			<p class="buttons">
				<button class="button ${stretch && !fresh.length ? '' : 'button--primary'}" type="button" data-needs="lead" data-of=${one.dataset} aria-disabled=${busy !== ''} title=${busy} onClick=${cameras.track}>${stretch ? 'Track again' : 'Track this shot'} <kbd>T</kbd></button>
				<button class="button" type="button" data-needs="lead" data-of=${one.dataset} aria-disabled=${busy !== ''} title=${busy || 'Makes a group of this frame and opens it in the calibration editor'} onClick=${cameras.correct}>Draw lines <kbd>E</kbd></button>
				${stretch ? html`<button class="button" type="button" aria-pressed=${stretch.summary.turned} data-needs="lead" data-of=${one.dataset} aria-disabled=${busy !== ''} title=${busy || 'The painted lines look the same from both sides of the pitch. Use this for a camera that stands opposite the main camera'} onClick=${cameras.turnHalf}>Turn to the other side <kbd>Shift T</kbd></button>` : null}
				${missing > 1 ? html`<button class="button" type="button" data-needs="lead" data-of=${one.dataset} title=${`Shots of the main camera and replays that have no cameras, except dropped ones; ${TOGETHER} at a time`} onClick=${cameras.trackAll}>${missing > TOGETHER ? `Track ${TOGETHER} of ${missing} shots` : `Track all ${missing} shots`} without cameras</button>` : null}
			</p>
			${stretch ? html`
				<p class="camera__files">Save as ${FILES.map(([format, label], index) => html`${index ? ', ' : ''}<a key=${format} class="link" href=${camerasFile(one.id, stretch.first, format)} download>${label}</a>`)}</p>` : null}
		</section>
	`;
}
