// @ts-check
/** Cameras over time as pictures: markings over the frame, outcomes as a band, and curves. */

import { html } from 'htm/preact';
import { useMemo } from 'preact/hooks';

import { stored } from '../../lib/storage.js';
import { markingsPath, OUTCOMES, runsOf } from '../../state/cameras.js';
import { goTo, seen, wanted } from '../../state/playback.js';
import { Chart, Numbers } from '../chart.js';

/** @import {FrameCamerasJson} from '../../api/cameras.js' */
/** @import {Cameras} from './camera_state.js' */
/** @import {Curve} from '../chart.js' */

const HEIGHT = 84;
/** Whether the curves are drawn, which takes height from the picture. */
const curvesShown = stored('camera curves', false);
const [PAN, TILT, FOCAL] = [3, 4, 6];

/** @type {Record<string, string>} */
const REASONS = {
	no_paint: 'no painted lines are found where they should be',
	paint_disagrees: 'the painted lines lie beside the projected ones',
	no_frame: 'its picture cannot be read',
};

/** The markings of the frame that is seen, where its camera puts them. @param {{cameras: Cameras}} props */
export function CameraLines({ cameras: { frames, lines, before } }) {
	const { frame } = seen.value;
	const path = useMemo(() => (frames && lines && frame >= frames.first && frame <= frames.last ? markingsPath(frames, frame) : ''), [frames, lines, frame]);
	if (!frames || !path) return null;
	const [width, height] = frames.size;
	return html`
		<svg class="camera__lines" viewBox="-0.5 -0.5 ${width} ${height}" data-frame=${frame} data-before=${before} aria-hidden="true"><clipPath id="camera-frame"><rect x="-0.5" y="-0.5" width=${width} height=${height} /></clipPath><g clip-path="url(#camera-frame)"><path d=${path} /><path d=${path} /></g></svg>
	`;
}

/** Outcomes in proportion; a click leads to its frame. @param {{frames: FrameCamerasJson}} props */
function Outcomes({ frames }) {
	const runs = useMemo(() => runsOf(frames), [frames]);
	const total = frames.outcome.length;
	/** @param {MouseEvent} event */
	function click(event) {
		const { left, width } = /** @type {HTMLElement} */ (event.currentTarget).getBoundingClientRect();
		goTo(frames.first + Math.min(Math.floor(((event.clientX - left) / width) * total), total - 1));
	}
	return html`
		<div class="camera__band" onClick=${click}>
			<ol class="camera__outcomes" aria-label="Outcomes">
				${runs.map(({ outcome, first, last }) => {
					const words = `${first === last ? `frame ${first}` : `frames ${first} to ${last}`}: ${OUTCOMES[outcome].name}`;
					return html`<li key=${first} style=${{ flexGrow: last - first + 1 }} data-outcome=${outcome} title=${words}><span class="hidden-text">${words}</span><span aria-hidden="true">${outcome}</span></li>`;
				})}
			</ol>
			${wanted.value >= frames.first && wanted.value <= frames.last ? html`<span class="film__head" style=${{ left: `${(100 * (wanted.value - frames.first + 0.5)) / total}%` }}></span>` : null}
		</div>
	`;
}

/** @param {FrameCamerasJson} frames @param {number} column @returns {(number | null)[]} */
const column = (frames, column) => frames.camera.map((row) => row?.[column] ?? null);

/** @param {number} value */
const two = (value) => value.toFixed(2);
/** @param {number} value */
const whole = (value) => value.toFixed(0);

/** The frame on screen, in words. @param {{cameras: Cameras}} props */
function ThisFrame({ cameras: { frames, before } }) {
	const place = frames ? wanted.value - frames.first : -1;
	if (!frames || place < 0 || place >= frames.outcome.length) return null;
	const { name, meaning } = OUTCOMES[frames.outcome[place]];
	const error = frames.error_px[place];
	const reason = frames.reason[place];
	const key = frames.keyframe.includes(wanted.value) ? ' Key frame.' : '';
	const more = error === null ? `${reason ? `: ${REASONS[reason] ?? reason.replaceAll('_', ' ')}` : `: ${meaning}`}.` : `: the painted lines lie ${error.toFixed(2)} px from the projected ones.`;
	const old = before ? ' These are the cameras before the last change.' : '';
	return html`<p class="camera__frame" title=${`Frame ${wanted.value} is ${name}${more}${key}${old}`}>Frame ${wanted.value} is <strong>${name}</strong>${more}${key}<strong>${old}</strong></p>`;
}

/** What leads through the frames of the shot. @param {{cameras: Cameras}} props */
function Tools({ cameras }) {
	return html`
		<div class="camera__tools">
			<button class="button button--small" type="button" title="The frame whose camera lies farthest from the paint" onClick=${cameras.worst}>Worst frame <kbd>W</kbd></button>
			<button class="button button--small" type="button" title="The next frame that is bridged or lost" onClick=${cameras.untracked}>Next untracked frame <kbd>N</kbd></button>
			<button class="button button--small" type="button" aria-pressed=${cameras.lines} onClick=${cameras.turnLines}>Projected lines <kbd>P</kbd></button>
			${cameras.stretch?.before ? html`<button class="button button--small" type="button" aria-pressed=${cameras.before} onClick=${cameras.turnBefore}>Previous cameras <kbd>B</kbd></button>` : null}
			<button class="button button--small" type="button" aria-pressed=${curvesShown.value} title="Error, pan, tilt and zoom of each frame" onClick=${() => { curvesShown.value = !curvesShown.value; }}>Curves</button>
			<${ThisFrame} cameras=${cameras} />
		</div>
	`;
}

/** @param {{cameras: Cameras}} props */
export function CameraCurves({ cameras }) {
	const { frames } = cameras;
	const charts = useMemo(() => (frames && curvesShown.value ? chartsOf(frames) : null), [frames, curvesShown.value]);
	if (!frames) return null;
	const frame = wanted.value;
	return html`
		<section class="card camera__curves" aria-label="Cameras over time">
			<${Tools} cameras=${cameras} />
			<${Outcomes} frames=${frames} />
			${charts ? html`
				<div class="camera__charts">
					${charts.map((chart) => html`
						<${Chart} key=${chart.yLabel} ...${chart} compact=${true} height=${HEIGHT} marker=${frame} onPick=${(/** @type {number} */ index) => goTo(frames.first + index)} />`)}
				</div>
				<${Numbers} x=${charts[0].x} xLabel="frame" curves=${charts.flatMap(({ curves }) => curves)} format=${two} />` : null}
		</section>
	`;
}

/** @param {FrameCamerasJson} frames */
function chartsOf(frames) {
	const x = frames.time.map((_, place) => frames.first + place);
	/** @param {string} yLabel @param {Curve[]} curves @param {(value: number) => string} format @param {[number | null, number | null]} [yRange] */
	const one = (yLabel, curves, format, yRange) => ({ name: `${curves.map(({ label }) => label).join(' and ')} of each frame`, xLabel: 'frame', yLabel, x, curves: curves.map((curve) => ({ ...curve, gaps: true })), format, yRange });
	return [
		one('share', [
			{ label: 'supported', values: frames.supported, colour: 'chart-a' },
			{ label: 'explained', values: frames.explained, colour: 'chart-b', dash: [6, 3] },
		], two, [0, 1]),
		one('px', [{ label: 'error, px', values: frames.error_px, colour: 'chart-d' }], two, [0, null]),
		one('pan', [{ label: 'pan, degrees', values: column(frames, PAN), colour: 'chart-a' }], two),
		one('tilt', [{ label: 'tilt, degrees (90 is level)', values: column(frames, TILT), colour: 'chart-b' }], two),
		one('focal px', [{ label: 'zoom, px', values: column(frames, FOCAL), colour: 'chart-c' }], whole),
	];
}
