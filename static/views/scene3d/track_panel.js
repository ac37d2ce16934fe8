// @ts-check
/** A track in space and on a plan of the pitch, frame after frame. Loaded when somebody asks for it. */

import { html } from 'htm/preact';
import { useEffect, useMemo, useState } from 'preact/hooks';

import { pathFromAbove } from '../../geometry/pitch.js';
import { fixed, metres } from '../../lib/format.js';
import { useSize } from '../../lib/hooks.js';
import { known, load } from '../../state/documents.js';
import { goToPreset, standpoint } from '../../state/scene3d.js';
import { EVENTS, MODES, runsOf, STATES } from '../../state/tracks.js';
import { Letter } from '../letter.js';
import { linesOf } from '../mini_pitch.js';
import { Presets, Stage, useImages } from './panel.js';
import { pointAt, trackScene, trailOf, withTrackNames } from './track_values.js';
import { sceneOf } from './values.js';

/** @import {TrackFrames, TrackJson} from '../../api/tracks.js' */
/** @import {GroupDocument} from '../../api/types.js' */
/** @import {SceneValues} from './values.js' */

/** Metres of ground around the pitch on the plan. */
const AROUND = 5;
/** @type {Map<string, ImageBitmap>} */
const NO_IMAGES = new Map();

/** The group that is nearest to a place, from the frame on towards the first. @param {TrackFrames} frames @param {number} place */
function groupNear({ group }, place) {
	return group.findLast((id, i) => id !== null && i <= place) ?? group.find((id) => id !== null) ?? null;
}

/** The group of the frame at hand; while it plays that where it last stood, so that cameras stand still. @param {TrackFrames} frames @param {number} place @param {boolean} plays @returns {GroupDocument | null} */
function useStandingGroup(frames, place, plays) {
	const [shown, setShown] = useState(/** @type {GroupDocument | null} */ (null));
	const id = groupNear(frames, place);
	useEffect(() => {
		if (id === null || (plays && shown)) return undefined;
		let wanted = true;
		// What cannot be read now is read with the next frame.
		Promise.resolve(known(id) ?? load(id)).then((found) => { if (wanted) setShown(found); }, () => {});
		return () => { wanted = false; };
	}, [id, plays]);
	return shown;
}

/** The path from above: what was measured is a line, what physics carries is dashed. @param {TrackFrames} frames */
function pathsOf(frames) {
	const kinds = frames.state.map((state) => (state === 'gap' ? 'gap' : state === 'measured' || state === 'one_view' ? 'seen' : 'carried'));
	return runsOf(kinds).flatMap(({ value, from, to }) => {
		if (value === 'gap') return [];
		const points = [];
		// It begins where the run before it ends.
		for (let i = Math.max(from - 1, 0); i <= to; i += 1) {
			const point = pointAt(frames, i);
			if (point) points.push(point);
		}
		return points.length > 1 ? [{ value, path: pathFromAbove(points) }] : [];
	});
}

/** The pitch from above with the path of the ball. @param {{scene: SceneValues, frames: TrackFrames, place: number, rate: number}} props */
function Plan({ scene, frames, place, rate }) {
	const [ref, size] = useSize();
	const { pitch: { length, width }, best, stands, seen } = scene;
	const [l, w] = [length / 2 + AROUND, width / 2 + AROUND];
	const pixel = (2 * l) / Math.max(1, size.width);
	const paths = useMemo(() => pathsOf(frames), [frames]);
	const trail = trailOf(frames, place, Math.round(rate));
	const words = best ? `The ball is at ${fixed(best.point[0], 1)}, ${fixed(best.point[1], 1)} metres` : 'The ball is not known';
	return html`
		<div class="track-plan" ref=${ref}>
			<svg viewBox=${`${-l} ${-w} ${2 * l} ${2 * w}`} role="img" aria-label=${`The path of the ball from above. ${words}.`}>
				<rect class="mini-pitch__grass" x=${-length / 2} y=${-width / 2} width=${length} height=${width} />
				${linesOf(length, width).map((line) => html`<path class="mini-pitch__line" d=${line} stroke-width=${pixel} />`)}
				${paths.map(({ value, path }) => html`<path class="track-plan__path" data-kind=${value} d=${path} stroke-width=${1.2 * pixel} stroke-dasharray=${value === 'carried' ? `${4 * pixel} ${3 * pixel}` : undefined} />`)}
				${frames.events.map(({ frame, kind, position: [x, y] }) => html`<circle key=${`${frame} ${kind}`} class="track-plan__event" data-kind=${kind} cx=${x} cy=${y} r=${2.6 * pixel}><title>${kind} in frame ${frame}</title></circle>`)}
				${trail.length ? html`<path class="track-plan__trail" d=${Array.from({ length: trail.length / 2 }, (_, i) => pathFromAbove(trail.slice(2 * i, 2 * i + 2))).join('')} stroke-width=${3 * pixel} />` : null}
				${best ? stands.filter(({ letter }) => seen?.has(letter)).map(({ letter, camera }) => html`<path key=${letter} class="mini-pitch__ray" data-letter=${letter} d=${pathFromAbove([camera.C, best.point])} stroke-width=${pixel} />`) : null}
				${best ? html`<circle class="mini-pitch__ball" cx=${best.point[0]} cy=${best.point[1]} r=${4 * pixel} stroke-width=${1.5 * pixel} />` : null}
			</svg>
			<p class="track-plan__key">${EVENTS.map(({ kind }) => html`<span key=${kind}><i data-kind=${kind}></i>${kind}</span>`)}<span>dashed: predicted</span></p>
		</div>
	`;
}

/** The same in words. @param {{scene: SceneValues, frames: TrackFrames, place: number}} props */
function Words({ scene: { best, stands, seen }, frames, place }) {
	const radii = best?.ellipsoid?.radii.map((radius) => fixed(radius, 2)).join(' × ');
	const ball = [MODES[frames.mode[place]].name, STATES[frames.state[place]], radii ? `2σ ${radii} m` : ''].filter(Boolean).join(', ');
	const velocity = frames.velocity[place];
	/** @param {readonly number[] | undefined} point */
	const cells = (point) => [0, 1, 2].map((axis) => html`<td key=${axis}>${point ? fixed(axis === 2 ? -point[axis] : point[axis], 2) : '–'}</td>`);
	return html`
		<table class="numbers">
			<thead><tr><th scope="col">metres</th><th scope="col">x</th><th scope="col">y</th><th scope="col">height</th></tr></thead>
			<tbody>
				<tr data-thing="ball"><th scope="row">Ball in frame ${frames.frame[place]}<small>${ball}</small></th>${cells(best?.point)}</tr>
				<tr data-thing="velocity"><th scope="row">Velocity<small>metres a second</small></th>${cells(velocity ?? undefined)}</tr>
				${stands.map(({ letter, label, camera }) => html`
					<tr key=${letter} data-thing=${`camera ${letter}`}>
						<th scope="row"><${Letter} letter=${letter} /> <span>${label}</span><small>${seen?.has(letter) ? 'sees the ball' : 'does not show it'}${best ? `, ${metres(Math.hypot(...camera.C.map((value, i) => value - best.point[i])))} away` : ''}</small></th>${cells(camera.C)}
					</tr>`)}
			</tbody>
		</table>
	`;
}

const onCanvas = () => document.activeElement instanceof HTMLCanvasElement;

/** @param {{track: TrackJson, frames: TrackFrames, at: number, plays: boolean, leave: () => void}} props */
export function TrackScene({ track, frames, at, plays, leave }) {
	const place = at - track.first;
	const group = useStandingGroup(frames, place, plays);
	const base = useMemo(() => group && sceneOf(group, group.solution), [group]);
	const stands = useMemo(() => withTrackNames(base?.stands ?? [], frames), [base, frames]);
	const scene = useMemo(() => base && trackScene({ pitch: base.pitch, stands, diameter: base.diameter }, frames, place, track.summary.rate), [base, stands, frames, place]);
	const images = useImages(group?.views ?? []);
	const habits = useMemo(() => ({ turns: onCanvas, leave, digits: false }), []);
	// Whoever looked through a camera of another scene does not look through one of this.
	useEffect(() => {
		if (standpoint.value.kind === 'camera') goToPreset('whole');
		return () => { if (standpoint.value.kind === 'camera') goToPreset('whole'); };
	}, []);
	if (!scene) return html`<p class="scene3d__missing" role="status">Reading the cameras…</p>`;
	return html`
		<${Stage} scene=${scene} images=${plays ? NO_IMAGES : images} habits=${habits} />
		<div class="scene3d__toolbar" role="toolbar" aria-label="Viewpoints"><${Presets} hasBall=${scene.best !== null} /></div>
		<div class="scene3d__table" tabindex="0" role="group" aria-label="The track in words">
			<${Plan} scene=${scene} frames=${frames} place=${place} rate=${track.summary.rate} />
			<${Words} scene=${scene} frames=${frames} place=${place} />
		</div>
	`;
}
