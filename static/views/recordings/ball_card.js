// @ts-check
/** The ball of a shot: followed from a click, looked at where it is uncertain, accepted. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { plural } from '../../lib/format.js';
import { ballAt, expectedDiameter, partsOf } from '../../state/ball_runs.js';
import { cameraAt } from '../../state/cameras.js';
import { goTo, seen, wanted } from '../../state/playback.js';
import { whyNot } from '../../state/rights.js';
import { FormError } from '../form_error.js';
import { NO_VIEW } from './ball_state.js';

/** @import {BallRunFrames, BallRunJson} from '../../api/ball_runs.js' */
/** @import {RecordingJson, Shot} from '../../api/recordings.js' */
/** @import {Balls, Place} from './ball_state.js' */
/** @import {Cameras} from './camera_state.js' */

const ENDS = { lost: 'until it was lost', left: 'until it left the picture' };
const WORDS = { followed: 'followed', uncertain: 'uncertain', confirmed: 'confirmed', lost: 'lost' };
/** Frames of the way that is drawn to either side. */
const WAY = 12;
/** Smallest radius of a mark and of the cross, as a share of the picture's width. */
const LEAST = 1 / 160;

/** Where a pointer is in the recording's picture; null: beside it. @param {RecordingJson} one @param {MouseEvent} event @returns {Place | null} */
function placeOf(one, event) {
	const { left, top, width, height } = /** @type {HTMLElement} */ (event.currentTarget).getBoundingClientRect();
	const [wide, high] = [one.width ?? 1, one.height ?? 1];
	const scale = Math.min(width / wide, height / high);
	const x = (event.clientX - left - (width - wide * scale) / 2) / scale - 0.5;
	const y = (event.clientY - top - (height - high * scale) / 2) / scale - 0.5;
	return x >= -0.5 && y >= -0.5 && x < wide && y < high ? { x, y } : null;
}

/** The ball over the frame: where it is, its way, and the size that is expected where somebody points. A click follows it. @param {{one: RecordingJson, balls: Balls, cameras: Cameras}} props */
export function BallOverlay({ one, balls, cameras: { frames } }) {
	const [over, setOver] = useState(/** @type {Place | null} */ (null));
	const { frame } = seen.value;
	const [width, height] = [one.width ?? 1, one.height ?? 1];
	const may = !whyNot('annotate', one.dataset);
	/** @param {MouseEvent} event */
	function click(event) {
		const at = placeOf(one, event);
		if (at && frame >= 0) balls.click(at, frame);
	}
	const pointed = balls.cross ?? over;
	const camera = frames && frame >= frames.first && frame <= frames.last ? cameraAt(frames, frame) : null;
	const expected = camera && pointed && expectedDiameter(camera, pointed);
	const least = width * LEAST;
	return html`
		<svg
			class="ball__layer" viewBox="-0.5 -0.5 ${width} ${height}" data-frame=${frame} data-may=${may} data-busy=${balls.busy} aria-hidden="true"
			onClick=${may ? click : undefined} onPointerMove=${(/** @type {PointerEvent} */ event) => setOver(may ? placeOf(one, event) : null)} onPointerLeave=${() => setOver(null)}
		>
			${balls.runs.map((run) => {
				const ball = ballAt(run, frame);
				return ball && html`
					<g key=${run.id} data-state=${ball.state} data-accepted=${run.accepted_by !== null}>
						<path class="ball__way" d=${wayOf(run, frame)} />
						<circle class="ball__mark ball__mark--under" cx=${ball.x} cy=${ball.y} r=${Math.max(ball.diameter / 2 + 2, least)} />
						<circle class="ball__mark" cx=${ball.x} cy=${ball.y} r=${Math.max(ball.diameter / 2 + 2, least)} />
					</g>`;
			})}
			${expected && pointed ? html`<circle class="ball__expected" cx=${pointed.x} cy=${pointed.y} r=${expected / 2} />` : null}
			${balls.cross ? html`<path class="ball__cross" d=${`M${balls.cross.x - 3 * least} ${balls.cross.y}h${2 * least}m${2 * least} 0h${2 * least}M${balls.cross.x} ${balls.cross.y - 3 * least}v${2 * least}m0 ${2 * least}v${2 * least}`} />` : null}
		</svg>
	`;
}

/** The way of the ball around a frame as data of a path. @param {BallRunFrames} run @param {number} frame */
function wayOf(run, frame) {
	let pen = false;
	return run.frame.map((number, row) => {
		const near = Math.abs(number - frame) <= WAY;
		const part = near ? `${pen && run.frame[row - 1] === number - 1 ? 'L' : 'M'}${run.x[row].toFixed(1)} ${run.y[row].toFixed(1)}` : '';
		pen = near;
		return part;
	}).join('');
}

/** Runs in proportion to the frames of a strip. @param {{runs: BallRunFrames[], all?: BallRunJson[], first: number, frames: number}} props */
export function BallBand({ runs, all = [], first, frames }) {
	/** @param {{first: number, last: number}} part */
	const place = (part) => ({ left: `${(100 * (part.first - first)) / frames}%`, width: `${(100 * (part.last - part.first + 1)) / frames}%` });
	const rest = all.filter(({ id }) => !runs.some((run) => run.id === id));
	return html`
		${rest.map((run) => html`<span key=${run.id} class="ball__part" data-state="followed" data-accepted=${run.accepted_by !== null} style=${place(run)}></span>`)}
		${runs.flatMap((run) => partsOf(run).map((part) => html`<span key=${`${run.id} ${part.first}`} class="ball__part" data-state=${part.state} data-accepted=${run.accepted_by !== null} style=${place(part)}></span>`))}
	`;
}

/** Why a run goes no further. @param {'lost' | 'left' | 'limit'} why @param {boolean} isEdge whether it reaches the edge of its shot @param {string} edge @param {number} frames from the outermost click */
function endText(why, isEdge, edge, frames) {
	if (why !== 'limit') return ENDS[why];
	return isEdge ? `to the ${edge} of the shot` : `for ${plural(frames, 'frame')}`;
}

/** The views that have an accepted ball, in words. @param {BallRunFrames} run */
function viewsText({ placed, kept }) {
	if (!placed && !kept) return `. ${NO_VIEW}`;
	return `: the ball was added to ${plural(placed ?? 0, 'view')}${kept ? `; ${plural(kept, 'view')} already had one and ${kept === 1 ? 'keeps' : 'keep'} it` : ''}.`;
}

/** @param {{one: RecordingJson, shot: Shot | undefined, balls: Balls}} props */
export function BallCard({ one, shot, balls }) {
	const { run, runs, busy, error } = balls;
	const ball = run && ballAt(run, wanted.value);
	const clicked = run?.clicks.some(({ frame }) => frame === wanted.value);
	const accepted = Boolean(run?.accepted_by);
	const why = busy ? 'The ball is being followed' : run ? '' : 'No ball is followed in this frame';
	const left = run ? run.uncertain - run.confirmed.length : 0;
	const sure = ball?.state === 'uncertain' ? '' : 'There is nothing to confirm at this frame';
	/** @param {MouseEvent} event */
	function jump(event) {
		const { left: begin, width } = /** @type {HTMLElement} */ (event.currentTarget).getBoundingClientRect();
		if (shot) goTo(Math.floor(shot.first + ((event.clientX - begin) / width) * (shot.last - shot.first + 1)));
	}
	/** Enter clicks while there is a cross, also where its button has the focus. @param {KeyboardEvent} event */
	function enter(event) {
		if (event.key !== 'Enter' || !balls.cross) return;
		event.preventDefault();
		balls.click(balls.cross);
	}
	return html`
		<section class="card ball" aria-label="Ball" aria-busy=${busy}>
			<h2>Ball${run ? html`<span class="card__aside">frames ${run.first} to ${run.last}</span>` : null}</h2>
			${run ? html`
				<p>${accepted ? html`<strong>Accepted</strong> by ${run.accepted_by}${viewsText(run)} ` : null}Followed backwards ${endText(run.before, run.first === shot?.first, 'beginning', run.clicks[0].frame - run.first)}, forwards ${endText(run.after, run.last === shot?.last, 'end', run.last - (run.clicks.at(-1)?.frame ?? run.last))}. ${left ? `${plural(left, 'frame')} uncertain.` : 'No frame is uncertain.'}</p>
				<p data-ball-state=${ball?.state ?? 'lost'}>${ball ? html`Frame ${wanted.value}: <strong>${WORDS[ball.state]}</strong>, ${ball.diameter.toFixed(1)} px wide, centre ± ${ball.sigma.toFixed(1)} px, ${clicked ? 'clicked here' : `${Math.round(100 * ball.confidence)} % sure`}.` : html`Frame ${wanted.value}: <strong>lost</strong>. Click the ball where it is seen.`}</p>
				${run.stale ? html`<p class="form__error">The video file has changed since then.</p>` : null}`
			: html`<p>${runs.length ? 'No ball is followed in this frame. ' : ''}Click the ball in the picture: it is followed forwards and backwards until it is lost.</p>`}
			${shot && runs.length ? html`
				<div class="ball__band" onClick=${jump}>
					<${BallBand} runs=${runs} first=${shot.first} frames=${shot.last - shot.first + 1} />
					<span class="film__head" style=${{ left: `${(100 * (wanted.value - shot.first + 0.5)) / (shot.last - shot.first + 1)}%` }}></span>
				</div>` : null}
			<div class="film__kinds" role="group" aria-label="Followed ball">
				<button class="button ${run && !accepted && !left ? 'button--primary' : ''}" type="button" data-needs="annotate" data-of=${one.dataset} aria-disabled=${why !== '' || accepted} title=${why || (accepted ? 'This ball is accepted already' : 'Adds the ball to the views that show these frames')} onClick=${balls.accept}>Accept <kbd>Y</kbd></button>
				<button class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-disabled=${why !== '' || !accepted} title=${why || (accepted ? 'Removes the balls that accepting added' : 'This ball is not accepted')} onClick=${balls.takeBack}>Withdraw <kbd>U</kbd></button>
				<button class="button" type="button" aria-disabled=${runs.length === 0} title=${runs.length ? '' : 'No ball is followed in this shot'} onClick=${balls.next}>Next uncertain <kbd>V</kbd></button>
				<button class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-disabled=${why !== '' || sure !== '' || accepted} title=${why || sure || 'Confirm that these uncertain frames are right'} onClick=${balls.confirm}>Confirm <kbd>O</kbd></button>
				<button class="button" type="button" data-needs="annotate" data-of=${one.dataset} aria-pressed=${balls.cross !== null} title="Shows a cross that the arrow keys move; Enter follows the ball from there" onClick=${balls.turnCross} onKeyDown=${enter}>Cross <kbd>F</kbd></button>
				<button class="button ${balls.question ? 'button--danger' : ''}" type="button" data-needs="annotate" data-of=${one.dataset} aria-disabled=${why !== ''} title=${why} aria-live="polite" onBlur=${balls.keep} onClick=${(/** @type {MouseEvent} */ event) => { if (event.detail < 2) balls.remove(); }}>${balls.question || 'Delete'} <kbd>Del</kbd></button>
			</div>
			<p role="status">${busy ? 'Following the ball…' : ''}</p>
			${error ? html`<${FormError} error=${error} />` : null}
		</section>
	`;
}
