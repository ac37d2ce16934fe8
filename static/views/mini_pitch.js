// @ts-check
/** The pitch from above: cameras, their rays, the ball of each pair and of all. */

import { html } from 'htm/preact';

import { cameraFromJson, rayThrough } from '../geometry/camera.js';
import { ballName, ballTold } from '../geometry/estimator.js';
import { pathFromAbove, pitchMarkings } from '../geometry/pitch.js';
import { ballCenter, ballOf } from '../geometry/preview.js';
import { clipSegment, spreadApart, within as inBox } from '../geometry/spread.js';
import { degrees, metres } from '../lib/format.js';
import { useSize } from '../lib/hooks.js';
import { NOISE_ASSUMED, noiseWords } from '../state/datasets.js';
import { groupDocument, isPreview } from '../state/group.js';
import { cycleEstimator, estimator } from '../state/workspace.js';
import { uncertainViews } from './view_state.js';

/** @import {GroupDocument, SolutionJson, ViewJson} from '../api/types.js' */
/** @import {Camera, PitchPoint} from '../geometry/camera.js' */

/** Metres beyond the pitch that are shown at most; cameras farther away stand at the edge. */
const MARGIN = 52;

/** How far a ray is drawn when it meets nothing, metres. */
const RAY = 130;
/** Rays that miss the 3D ball end this far beyond the pitch at the latest, metres. */
const APRON = 4;
/** Radius of a camera's mark, and least distance of two, CSS pixels. */
const MARK = 7;
const APART = 16;
/** A mark that was moved farther than this shows where its camera stands, CSS pixels. */
const MOVED = 3;

/** @typedef {{letter: string, x: number, y: number, ray: PitchPoint | null}} Stand */

/** @param {GroupDocument} group @param {SolutionJson} solution @returns {Stand[]} */
function stands(group, solution) {
	return group.views.flatMap((view) => {
		const json = solution.views.find((one) => one.view === view.key)?.calibration.camera;
		if (!json) return [];
		const [x, y] = json.position_meters;
		return [{ letter: view.letter, x, y, ray: rayEnd(view, cameraFromJson(json), solution) }];
	});
}

/**
 * Where the ray of a view's ball ends: at the 3D ball, else on the grass.
 *
 * @param {ViewJson} view @param {Camera} camera @param {SolutionJson} solution
 * @returns {PitchPoint | null}
 */
function rayEnd(view, camera, solution) {
	if (solution.ball?.views.includes(view.key)) return solution.ball.point;
	const ball = ballOf(view);
	const center = ball && ballCenter(ball);
	const ray = center && rayThrough(camera, center);
	if (!ray) return null;
	const toGrass = ray[2] > 0 ? -camera.C[2] / ray[2] : Infinity;
	const t = Math.min(toGrass, RAY / Math.hypot(ray[0], ray[1]));
	return [camera.C[0] + t * ray[0], camera.C[1] + t * ray[1], camera.C[2] + t * ray[2]];
}

/** The part of the ground that shows pitch and cameras. @param {GroupDocument} group @param {Stand[]} cameras */
function frameOf(group, cameras) {
	const [l, w] = [group.pitch.length / 2, group.pitch.width / 2];
	const xs = [-l, l, ...cameras.map(({ x }) => Math.max(-l - MARGIN, Math.min(l + MARGIN, x)))];
	const ys = [-w, w, ...cameras.map(({ y }) => Math.max(-w - MARGIN, Math.min(w + MARGIN, y)))];
	const [left, top] = [Math.min(...xs) - 7, Math.min(...ys) - 7];
	return { left, top, width: Math.max(...xs) + 7 - left, height: Math.max(...ys) + 7 - top };
}

/**
 * The ray as far as it is drawn: from where its camera stands to the ball, or to where it leaves
 * the ground that is shown.
 *
 * @param {Stand} stand @param {GroupDocument} group @param {ReturnType<typeof frameOf>} frame
 * @returns {PitchPoint[] | null}
 */
function rayOf({ x, y, ray }, { pitch }, { left, top, width, height }) {
	if (!ray) return null;
	const shown = { left, top, right: left + width, bottom: top + height };
	const inner = clipSegment({ x, y }, { x: ray[0], y: ray[1] }, shown);
	if (!inner) return null;
	const [l, w] = [pitch.length / 2 + APRON, pitch.width / 2 + APRON];
	const over = clipSegment(inner[0], inner[1], { left: -l, top: -w, right: l, bottom: w });
	const end = over ? over[1] : inner[1];
	return [[inner[0].x, inner[0].y, 0], [end.x, end.y, 0]];
}

/** @type {Map<string, string[]>} */
const drawn = new Map();

/** The lines of a pitch as paths, made once for each size. @param {number} length @param {number} width */
export function linesOf(length, width) {
	const key = `${length} ${width}`;
	const lines = drawn.get(key) ?? [...pitchMarkings(length, width).values()].map(pathFromAbove);
	drawn.set(key, lines);
	return lines;
}

/** @param {ReturnType<typeof frameOf>} frame @param {PitchPoint} point */
function within({ left, top, width, height }, [x, y]) {
	return x > left && x < left + width && y > top && y < top + height;
}

/** @param {{group: GroupDocument, solution: SolutionJson}} props */
function Drawing({ group, solution }) {
	const [ref, size] = useSize();
	const cameras = stands(group, solution);
	const frame = frameOf(group, cameras);
	// One unit of the drawing is a metre; marks keep their size on screen.
	const pixel = Math.max(frame.width / Math.max(1, size.width), frame.height / Math.max(1, size.height));
	const ball = solution.ball?.point;
	const guessed = new Set(uncertainViews(group, solution).filter(({ guess }) => guess.includes('position')).map(({ view }) => view.letter));
	const [l, w] = [group.pitch.length, group.pitch.width];
	const rim = (MARK + 1) * pixel;
	const room = {
		left: frame.left + rim, top: frame.top + rim, right: frame.left + frame.width - rim, bottom: frame.top + frame.height - rim,
	};
	const marks = spreadApart(cameras, APART * pixel, room, ball ? [{ x: ball[0], y: ball[1] }] : []);
	return html`
		<div class="mini-pitch__drawing" ref=${ref}>
			<svg viewBox=${`${frame.left} ${frame.top} ${frame.width} ${frame.height}`} role="img" aria-label="The pitch from above">
				<rect class="mini-pitch__grass" x=${-l / 2} y=${-w / 2} width=${l} height=${w} rx=${pixel} />
				${linesOf(l, w).map((line) => html`<path class="mini-pitch__line" d=${line} stroke-width=${pixel} />`)}
				${cameras.map((stand) => {
					const ray = rayOf(stand, group, frame);
					return ray ? html`<path class="mini-pitch__ray" data-letter=${stand.letter} d=${pathFromAbove(ray)} stroke-width=${1.3 * pixel} />` : null;
				})}
				${solution.pairs.filter(({ point }) => within(frame, point)).map(({ point, valid }) => html`
					<circle class="mini-pitch__pair" data-valid=${valid} cx=${point[0]} cy=${point[1]} r=${2.4 * pixel} stroke-width=${1.2 * pixel} />`)}
				${cameras.map(({ letter, ...stand }, i) => {
					const [{ x, y }, at] = [marks[i], inBox(stand, room)];
					return Math.hypot(x - at.x, y - at.y) < MOVED * pixel ? null : html`
						<g class="mini-pitch__leader" data-letter=${letter} stroke-width=${pixel}>
							<path d=${pathFromAbove([[at.x, at.y, 0], [x, y, 0]])} />
							<circle cx=${at.x} cy=${at.y} r=${1.8 * pixel} />
						</g>`;
				})}
				${cameras.map(({ letter }, i) => {
					const { x, y } = marks[i];
					return html`
						<g class="mini-pitch__camera" data-letter=${letter} data-uncertain=${guessed.has(letter)}>
							${guessed.has(letter) ? html`<title>The lines of ${letter} do not determine where its camera stands</title>` : null}
							<circle cx=${x} cy=${y} r=${MARK * pixel} />
							<text x=${x} y=${y} dy=${3.6 * pixel} font-size=${10 * pixel}>${letter}</text>
						</g>`;
				})}
				${ball ? html`<circle class="mini-pitch__ball" cx=${ball[0]} cy=${ball[1]} r=${3.4 * pixel} stroke-width=${1.5 * pixel} />` : null}
			</svg>
		</div>
	`;
}

/** @param {{solution: SolutionJson, noise: string}} props */
function Numbers({ solution, noise }) {
	const { ball } = solution;
	if (!ball) return html`<p class="mini-pitch__none">No 3D ball: no pair is valid.</p>`;
	const [x, y] = ball.point;
	return html`
		<dl class="mini-pitch__numbers">
			<div><dt>x</dt><dd data-number="x">${metres(x)}</dd></div>
			<div><dt>y</dt><dd data-number="y">${metres(y)}</dd></div>
			<div><dt>height</dt><dd data-number="height">${metres(ball.height_m)}</dd></div>
			<div><dt>σ</dt><dd data-number="sigma">${metres(ball.sigma_m)}</dd></div>
			<div><dt title="Parallax: angle between the rays">β</dt><dd data-number="parallax">${degrees(ball.parallax_degrees)}</dd></div>
			${noise ? html`<div class="mini-pitch__noise" title=${NOISE_ASSUMED}><dt>σ:</dt><dd>${noise}</dd></div>` : null}
		</dl>
	`;
}

/** Which 3D ball the numbers speak of, and the way to the other one. @param {{solution: SolutionJson}} props */
function Estimator({ solution }) {
	const other = estimator.value === 'other';
	const saved = groupDocument.value?.solution ?? null;
	const exported = ballName(saved, 'exported');
	const { name, state } = ballTold(solution, estimator.value, saved, isPreview.value);
	return html`
		<span class="card__aside">3D point: <button
			class="link-button" type="button" aria-pressed=${other} onClick=${cycleEstimator}
			title=${`The ${exported} is exported, as the policy says. The pair average is the mean of the points of all valid pairs, as in the paper; the most likely point fits all views at once (T)`}
		>${name}</button> <span class="mini-pitch__state">(${state})</span></span>
	`;
}

/** @param {{group: GroupDocument, solution: SolutionJson | null}} props */
export function MiniPitch({ group, solution }) {
	return html`
		<section class="card strip-card mini-pitch" aria-label="Pitch">
			<h2>Pitch${solution?.best_ball && solution.ball ? html` <${Estimator} solution=${solution} />` : null}</h2>
			${solution ? html`
				<${Drawing} group=${group} solution=${solution} />
				<${Numbers} solution=${solution} noise=${noiseWords(group.policy)} />` : html`<p class="empty-note">Not solved yet.</p>`}
		</section>
	`;
}
