// @ts-check
/** The shot that is shown: what it is, and what can be done with it. */

import { html } from 'htm/preact';

import { findShots } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { isOver, jobToShow } from '../../state/jobs.js';
import { lengthText, changedAt, mergedWithNext, SHOT_KINDS, splitAt } from '../../state/shots.js';
import { wanted } from '../../state/playback.js';
import { FormError } from '../form_error.js';
import { JobProgress } from '../job_progress.js';
import { useEnded } from '../running_jobs.js';

/** @import {RecordingJson, Shot} from '../../api/recordings.js' */
/** @import {RunningJobs} from '../running_jobs.js' */

const ENTERED = { start: 'at the beginning of the recording', cut: 'after a cut', dissolve: 'after a dissolve', wipe: 'after a wipe', fade: 'after a fade' };

/** Finds all shots anew, and indexes what is not indexed as it is now. @param {{one: RecordingJson, running: RunningJobs, label: string, before?: () => void, over?: () => void}} props */
export function FindAgain({ one, running: { jobs, watch }, label, before = () => {}, over = () => {} }) {
	const { error, attempt } = useAttempt();
	const finding = jobs.filter(({ kind }) => kind === 'recording');
	const job = jobToShow(finding);
	const busy = job !== null && !isOver(job);
	useEnded(finding, over);
	function find() {
		if (busy) return;
		before();
		attempt(findShots(one.id), watch);
	}
	return html`
		<p class="buttons"><button class="button" type="button" data-needs="lead" data-of=${one.dataset} aria-disabled=${busy} title=${busy ? 'Shots are being found' : ''} onClick=${find}>${label}</button></p>
		${error ? html`<${FormError} error=${error} />` : null}
		${job && job.state !== 'done' ? html`<${JobProgress} job=${job} />` : null}
	`;
}

/** @param {{one: RecordingJson, running: RunningJobs, shots: Shot[], at: number, change: (items: Shot[] | null, told: string) => void, remember: () => void}} props */
export function ShotCard({ one, running, shots, at, change, remember }) {
	const shot = shots[at];
	if (!shot) return html`<section class="card" aria-label="Shot"><h2>Shot</h2><p class="empty-note">This recording has no shot.</p><${FindAgain} one=${one} running=${running} label="Find all shots again" before=${remember} /></section>`;
	const frame = wanted.value;
	const split = splitAt(shots, frame) ? '' : 'Go to a frame within the shot first';
	const merge = at + 1 < shots.length ? '' : 'This is the last shot';
	/** @param {Partial<Shot>} what @param {string} told */
	const set = (what, told) => change(changedAt(shots, at, what), told);
	return html`
		<section class="card" aria-label="Shot">
			<h2>Shot ${at + 1} of ${shots.length}<span class="card__aside">${lengthText((shot.last - shot.first + 1) / (one.fps ?? 25))}</span></h2>
			<p>Frames ${shot.first} to ${shot.last}, ${ENTERED[shot.entered_by]}. ${shot.kept === null ? '' : shot.kept ? 'Kept.' : 'Dropped.'}</p>
			<div class="film__kinds" role="group" aria-label="Kind">
				${SHOT_KINDS.map(({ kind, letter, label }, index) => html`
					<button key=${kind} class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-pressed=${shot.kind === kind} onClick=${() => set({ kind }, `The kind of this shot is now ${label}.`)}>
						<span class="film__letter" data-kind=${kind} aria-hidden="true">${letter}</span>${label} <kbd>${index + 1}</kbd>
					</button>`)}
			</div>
			<div class="film__kinds" role="group" aria-label="Shot">
				<button class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-pressed=${shot.kept === true} onClick=${() => set({ kept: true }, 'The shot is kept.')}>Keep <kbd>A</kbd></button>
				<button class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-pressed=${shot.kept === false} onClick=${() => set({ kept: false }, 'The shot is dropped.')}>Drop <kbd>X</kbd></button>
				<button class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-disabled=${split !== ''} title=${split} onClick=${() => change(splitAt(shots, frame), 'Split.')}>Split <kbd>S</kbd></button>
				<button class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-disabled=${merge !== ''} title=${merge} onClick=${() => change(mergedWithNext(shots, at), 'Merged with the next shot.')}>Merge <kbd>M</kbd></button>
			</div>
			<${FindAgain} one=${one} running=${running} label="Find all shots again" before=${remember} />
			<p class="buttons">${/** @type {const} */ (['shots', 'links']).map((what) => html`<a key=${what} class="link" href=${`/api/v1/recordings/${one.id}/${what}.csv`} download>All ${what} as CSV</a>`)}</p>
		</section>
	`;
}
