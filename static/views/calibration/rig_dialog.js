// @ts-check
/** All static cameras adjusted together: what that would change, then saved or taken back. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { ApiError, sentenceOf } from '../../api/problem.js';
import { deleteRig, postRig } from '../../api/match_estimates.js';
import { capital, count, fixed, metres, pixelText, pixels, plural } from '../../lib/format.js';
import { follow, isOver } from '../../state/jobs.js';
import { announce } from '../../state/notice.js';
import { watchSolving } from '../../state/solving.js';
import { FormDialog } from '../dialog.js';
import { JobProgress } from '../job_progress.js';

/** @import {JobJson} from '../../api/jobs.js' */
/** @import {Accepted, RigProposal} from '../../api/match_estimates.js' */

const CHOICES = /** @type {{name: Accepted, label: string, note: string}[]} */ ([
	{ name: 'cameras', label: 'The adjusted cameras', note: 'balls move; can be undone' },
	{ name: 'sigma', label: 'Keep the present cameras', note: 'no ball moves; only their uncertainty is corrected' },
]);

/** @param {number | null} before @param {number | null} after */
function change(before, after) {
	return before === null || after === null ? '–' : `${pixels(before)} → ${pixels(after)} px`;
}

/** @param {{proposal: RigProposal}} props */
function Proposal({ proposal }) {
	return html`
		<div class="table__scroll" tabindex="0" role="region" aria-label="Cameras and pairs, before and after">
			<table class="table">
				<thead><tr><th>Camera</th><th data-numeric="true">Moves</th><th data-numeric="true" title="How far points on the pitch move in the picture of this camera">Shift in the picture</th><th data-numeric="true">Field lines</th></tr></thead>
				<tbody>${proposal.cameras.map((camera) => html`
					<tr key=${camera.key} data-camera=${camera.key}>
						<th scope="row">${camera.key}</th>
						<td data-numeric="true">${metres(camera.moved_m)} <small>±${fixed(camera.position_sigma_m, 2)}</small></td>
						<td data-numeric="true">${pixelText(camera.picture_px)}</td>
						<td data-numeric="true">${change(camera.lines_before_px, camera.lines_after_px)}</td>
					</tr>`)}</tbody>
			</table>
			<table class="table">
				<thead><tr><th>Camera pair</th><th data-numeric="true">Instants</th><th data-numeric="true" title="Distance between the balls of both cameras, before and after">Error</th><th data-numeric="true" title="The same for balls that the adjustment did not use">Error, test balls</th></tr></thead>
				<tbody>${proposal.pairs.map((pair) => html`
					<tr key=${`${pair.a} ${pair.b}`}>
						<th scope="row">${pair.a} and ${pair.b}</th>
						<td data-numeric="true">${count(pair.frames)}</td>
						<td data-numeric="true">${change(pair.before_px, pair.after_px)}</td>
						<td data-numeric="true">${change(pair.held_out_before_px, pair.held_out_after_px)}</td>
					</tr>`)}</tbody>
			</table>
		</div>
		<p>${plural(proposal.frames, 'instant')} ${proposal.frames === 1 ? 'was' : 'were'} used, ${count(proposal.gross)} left out, because the rays of their cameras do not meet in one ball. The median ball moves by ${metres(proposal.ball_moved_m)}. The cameras are ${proposal.anchor}. ${capital(proposal.time)}.</p>
		${proposal.left_alone.length ? html`<p data-grade="warn">Not adjusted, because too few balls are seen together with other cameras: ${proposal.left_alone.join(', ')}</p>` : null}
	`;
}

/** @param {{dataset: {id: number, name: string}, onClose: () => void}} props */
export function RigDialog({ dataset, onClose }) {
	const [job, setJob] = useState(/** @type {JobJson | null} */ (null));
	const [proposal, setProposal] = useState(/** @type {RigProposal | null} */ (null));
	const [what, setWhat] = useState(/** @type {Accepted} */ ('sigma'));
	const [problem, setProblem] = useState(/** @type {{text: string, adjusted: boolean} | null} */ (null));
	const busy = job !== null && !isOver(job);
	/** @param {() => Promise<void>} act @param {boolean} proposes refused (409) where the cameras were adjusted already, which can be undone */
	async function attempt(act, proposes) {
		setProblem(null);
		try {
			await act();
		} catch (error) {
			setJob(null);
			setProblem({ text: sentenceOf(error), adjusted: error instanceof ApiError && error.status === 409 ? proposes : Boolean(problem?.adjusted) });
		}
	}
	async function send() {
		if (busy) return;
		await attempt(async () => {
			const body = proposal ? { accept: what, inputs: proposal.inputs } : {};
			const over = await follow(await postRig(dataset.id, body), setJob);
			if (over.state !== 'done') {
				// What it rests on may have changed: the next one is looked at first.
				if (over.state === 'failed') setProposal(null);
				return;
			}
			if (!over.result.accepted) { setProposal(over.result); return; }
			announce(what === 'cameras' ? 'The adjusted cameras are used.' : 'The cameras stay; their uncertainty is saved.');
			watchSolving(dataset.name);
			onClose();
		}, true);
	}
	async function takeBack() {
		await attempt(async () => {
			const { taken_back: cameras } = await deleteRig(dataset.id);
			announce(`${plural(cameras, 'camera')} ${cameras === 1 ? 'is' : 'are'} restored.`);
			watchSolving(dataset.name);
			onClose();
		}, false);
	}
	return html`
		<${FormDialog}
			wide=${true} title="Adjust static cameras together" onClose=${onClose} onSubmit=${send}
			buttons=${html`
				${problem?.adjusted ? html`<button class="button" type="button" onClick=${takeBack}>Restore the previous cameras</button>` : null}
				<button class="button button--primary" type="submit" aria-disabled=${busy} title=${busy ? 'Under way' : ''}>${proposal ? 'Save' : 'Propose'}</button>`}
		>
			<p>Balls that several cameras show at once align the cameras with each other; field lines and the cameras in use keep them in place. A preview shows what changes before anything is saved.</p>
			${proposal ? html`
				<${Proposal} proposal=${proposal} />
				<fieldset class="choice choice--row">
					<legend>Save</legend>
					${CHOICES.map(({ name, label, note }) => html`
						<label key=${name}>
							<input type="radio" name="accept" checked=${what === name} onChange=${() => setWhat(name)} />
							<span>${label}<small>${note}</small></span>
						</label>`)}
				</fieldset>` : null}
			${job && (busy || job.state !== 'done') ? html`<${JobProgress} job=${job} />` : null}
			${problem ? html`<p class="form__error" role="alert">${problem.text}</p>` : null}
		<//>
	`;
}
