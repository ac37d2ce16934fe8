// @ts-check
/** One track: its curves with their bands, its modes and events, and what is said of it. */

import { html } from 'htm/preact';
import { useMemo, useRef, useState } from 'preact/hooks';

import { ApiError } from '../../api/problem.js';
import { getTrack, getTrackFrames, patchTrack } from '../../api/tracks.js';
import { fixed, plural } from '../../lib/format.js';
import { useKeys } from '../../lib/hooks.js';
import { useResource } from '../../lib/resource.js';
import { page } from '../../lib/router.js';
import { announce, complain } from '../../state/notice.js';
import { corrected, curvesOf, eventAt, EVENTS, MODES, mostShown, partOf, runsOf, STATES } from '../../state/tracks.js';
import { Chart, Numbers } from '../chart.js';
import { pageAddress } from '../dataset_menu.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { keysOfTrack } from './track_keys.js';
import { verdictText } from './tracks_page.js';

/** @import {EventKind, TrackFrames, TrackJson} from '../../api/tracks.js' */
/** @import {Curve} from '../chart.js' */

const HEIGHT = 104;
/** Left-out error beyond which clicks alone are no reason, pixels. */
const CLICK_PX = 2;
/** Frames that are shown at first. */
const WINDOW = 500;
/** @param {number} value */
const centimetres = (value) => value.toFixed(2);
/** @param {number} value */
const tenths = (value) => value.toFixed(1);

/** Every frame of a track, in as many answers as it takes. @param {TrackJson} track @param {AbortSignal} signal @returns {Promise<TrackFrames>} */
async function framesOf(track, signal) {
	const whole = await getTrackFrames(track.id, track.first, signal);
	while ((whole.frame.at(-1) ?? track.last) < track.last) {
		const more = await getTrackFrames(track.id, (whole.frame.at(-1) ?? track.last) + 1, signal);
		for (const [name, list] of Object.entries(more)) if (Array.isArray(list)) /** @type {any} */ (whole)[name].push(...list);
	}
	return whole;
}

/** Modes and states in proportion, and events above them; a click leads to its frame. @param {{frames: TrackFrames, at: number, goTo: (frame: number) => void}} props */
function Band({ frames, at, goTo }) {
	const [modes, states] = useMemo(() => [runsOf(frames.mode), runsOf(frames.state)], [frames]);
	const [first, total] = [frames.frame[0], frames.frame.length];
	/** @param {number} frame */
	const left = (frame) => `${(100 * (frame - first + 0.5)) / total}%`;
	/** @param {MouseEvent} event */
	function click(event) {
		const box = /** @type {HTMLElement} */ (event.currentTarget).getBoundingClientRect();
		goTo(first + Math.min(Math.floor(((event.clientX - box.left) / box.width) * total), total - 1));
	}
	const inside = frames.events.filter(({ frame }) => frame >= first && frame < first + total);
	const shown = at >= first && at < first + total;
	return html`
		<div class="track__band" onClick=${click}>
			<ol class="track__events" aria-label="Events">
				${inside.map((event) => html`<li key=${`${event.frame} ${event.kind}`} style=${{ left: left(event.frame) }} data-kind=${event.kind} data-added=${event.added} title=${`${event.kind} in frame ${event.frame}`}><span class="hidden-text">${event.kind} in frame ${event.frame}</span><span aria-hidden="true">${EVENTS.find(({ kind }) => kind === event.kind)?.letter}</span></li>`)}
			</ol>
			<ol class="track__modes" aria-label="What the ball does">
				${modes.map(({ value, from, to }) => html`<li key=${from} style=${{ flexGrow: to - from + 1 }} data-mode=${value || 'gap'} title=${`${MODES[value].name}: frames ${frames.frame[from]} to ${frames.frame[to]}`}><span class="hidden-text">${MODES[value].name}, frames ${frames.frame[from]} to ${frames.frame[to]}</span><span aria-hidden="true">${MODES[value].letter}</span></li>`)}
			</ol>
			<ol class="track__states" aria-label="How it is known">
				${states.map(({ value, from, to }) => html`<li key=${from} style=${{ flexGrow: to - from + 1 }} data-state=${value} title=${STATES[value]}><span class="hidden-text">${STATES[value]}, frames ${frames.frame[from]} to ${frames.frame[to]}</span></li>`)}
			</ol>
			${shown ? html`<span class="film__head" style=${{ left: left(at) }}></span>` : null}
		</div>
	`;
}

/** @param {TrackFrames} frames */
function chartsOf(frames) {
	const names = /** @type {const} */ (['x, m', 'y, m', 'height, m']);
	const charts = names.map((label, axis) => {
		const { values, low, high, raw } = curvesOf(frames, /** @type {0 | 1 | 2} */ (axis));
		const track = { label, values, low, high, gaps: true, colour: /** @type {const} */ ('chart-a') };
		const alone = { label: `${label.split(',')[0]} of each frame alone`, values: raw, colour: /** @type {const} */ ('chart-b'), points: 4 };
		return { name: `${label} of the ball in each frame, with a band of two sigma`, yLabel: label, curves: /** @type {Curve[]} */ ([alone, track]), format: centimetres };
	});
	const most = mostShown(frames.left_out_px);
	/** @type {Curve} */
	const left = { label: `left-out error, px (up to ${most})`, values: frames.left_out_px.map((value) => (value === null ? null : Math.min(value, most))), colour: 'chart-d', points: 4 };
	return [...charts, { name: 'Error of what was left out and predicted, in each frame', yLabel: 'px', curves: [left], format: tenths, yRange: /** @type {[number | null, number | null]} */ ([0, null]) }];
}

/** What is known of the frame at hand. @param {{track: TrackJson, frames: TrackFrames, at: number, goTo: (frame: number) => void}} props */
function FrameCard({ track, frames, at, goTo }) {
	const place = at - track.first;
	const [x, y, z, sigma] = [frames.x[place], frames.y[place], frames.z[place], frames.sigma[place]];
	const velocity = frames.velocity[place];
	const group = frames.group[place];
	const against = frames.contradicted.filter(({ frame }) => frame === at);
	const event = eventAt(frames.events, at);
	const { worst } = track.summary;
	return html`
		<section class="card" aria-labelledby="frame-title" data-frame=${at}>
			<h2 id="frame-title">Frame ${at} <small>${frames.time_s[place].toFixed(2)} s</small></h2>
			<dl class="facts">
				<dt>Ball</dt><dd>${x === null || y === null || z === null ? 'not known' : `${fixed(x, 2)}, ${fixed(y, 2)}, ${fixed(-z, 2)} m up`}</dd>
				<dt>Sigma</dt><dd>${sigma === null ? '–' : `${fixed(sigma, 2)} m`}</dd>
				<dt>Speed</dt><dd>${velocity ? `${fixed(3.6 * Math.hypot(...velocity), 0)} km/h` : '–'}</dd>
				<dt>Known</dt><dd>${STATES[frames.state[place]]}${frames.views[place].length ? ` (${frames.views[place].join(', ')})` : ''}</dd>
				<dt>Does</dt><dd>${MODES[frames.mode[place]].name}${event ? `; ${event.kind} in frame ${event.frame}` : ''}</dd>
				<dt>Left out</dt><dd>${frames.left_out_px[place] === null ? '–' : `${fixed(frames.left_out_px[place], 1)} px`}</dd>
			</dl>
			${against.map((one) => html`<div class="track__against" key=${one.view}><p><strong>${one.view}</strong> is ${fixed(one.px, 0)} px off. ${one.sentence}</p><p class="note">${one.fix}</p></div>`)}
			<p class="buttons">
				${group === null ? html`<button class="button" type="button" aria-disabled="true" title="No group shows this frame">Open its group</button>` : html`<a class="button" href=${`/review/${group}`}>Open its group <kbd>Enter</kbd></a>`}
				${worst === null ? null : html`<button class="button" type="button" onClick=${() => goTo(worst)}>Worst frame <kbd>w</kbd></button>`}
			</p>
		</section>
	`;
}

/** @param {{track: TrackJson, judge: (verdict: 'accepted' | 'rejected' | 'none') => void}} props */
function VerdictCard({ track, judge }) {
	const { summary } = track;
	const why = track.stale ? 'Its groups have changed: make it again first' : '';
	/** @param {'accepted' | 'rejected'} verdict */
	const press = (verdict) => judge(track.verdict === verdict ? 'none' : verdict);
	return html`
		<section class="card" aria-labelledby="track-title">
			<h2 id="track-title">Track</h2>
			<p>${verdictText(track)}${track.judged_by && track.verdict ? html` by ${track.judged_by}` : null}</p>
			<p class="note">${summary.median_px === null ? 'Nothing could be left out' : `Left out and predicted: median ${fixed(summary.median_px, 1)} px, 95 % within ${fixed(summary.p95_px, 1)} px`}. ${plural(summary.measurements, 'ball')} of all views${summary.contradicted ? `, ${summary.contradicted} contradict it` : ''}.</p>
			${(summary.median_px ?? 0) > CLICK_PX ? html`<p class="note">Left-out balls are missed by more than clicks are: its cameras contradict each other. An adjustment to lines and balls (<code>touchline rig</code>) may bring them together.</p>` : null}
			<p class="buttons">
				<button class="button" type="button" data-needs="review" data-of=${track.dataset} aria-pressed=${track.verdict === 'accepted'} aria-disabled=${why !== ''} title=${why} onClick=${() => { if (!why) press('accepted'); }}>Accept <kbd>a</kbd></button>
				<button class="button" type="button" data-needs="review" data-of=${track.dataset} aria-pressed=${track.verdict === 'rejected'} onClick=${() => press('rejected')}>Reject <kbd>x</kbd></button>
			</p>
			${track.stale ? html`<p class="note">${why}: <a class="link" href=${pageAddress(track.dataset, 'tracks')}>tracks of ${track.dataset}</a>.</p>` : null}
		</section>
	`;
}

/** @param {{frames: TrackFrames, at: number, goTo: (frame: number) => void, correct: (kind: EventKind, added: boolean) => void}} props */
function EventCard({ frames, at, goTo, correct }) {
	const event = eventAt(frames.events, at);
	return html`
		<section class="card" aria-labelledby="events-title">
			<h2 id="events-title">Events <small>${frames.events.length}</small></h2>
			<p class="buttons">
				${EVENTS.map(({ kind, key }) => html`<button key=${kind} class="button button--small" type="button" data-needs="review" onClick=${() => correct(kind, true)}>Add ${kind} <kbd>${key}</kbd></button>`)}
				<button class="button button--small" type="button" data-needs="review" aria-disabled=${!event} title=${event ? '' : 'No event is near this frame'} onClick=${() => { if (event) correct(event.kind, false); }}>Remove${event ? ` ${event.kind}` : ''} <kbd>d</kbd></button>
			</p>
			<ol class="track__list" aria-label="List of events">
				${frames.events.map((one) => html`<li key=${`${one.frame} ${one.kind}`}><button class="track__event" type="button" aria-current=${one === event ? 'true' : undefined} onClick=${() => goTo(one.frame)}><span class="mono">${one.frame}</span> ${one.kind}${one.added ? ' (added)' : ''}</button></li>`)}
			</ol>
		</section>
	`;
}

/** @param {{track: TrackJson, setTrack: (track: TrackJson) => void}} props */
function Track({ track, setTrack }) {
	const found = useResource((signal) => framesOf(track, signal), [track.id, track.etag]);
	const [at, setAt] = useState(track.summary.worst ?? track.first);
	const [width, setWidth] = useState(Math.min(track.last - track.first + 1, WINDOW));
	const sending = useRef(false);
	const frames = found.value;
	/** @param {number} frame */
	const goTo = (frame) => setAt(Math.min(Math.max(frame, track.first), track.last));
	/** @param {Parameters<typeof patchTrack>[1]} body @param {string} told */
	async function send(body, told) {
		if (sending.current) return;
		sending.current = true;
		try {
			setTrack(await patchTrack(track, body));
			announce(told);
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			complain(problem.message);
			if (problem.status === 412) setTrack(await getTrack(track.id));
		} finally {
			sending.current = false;
		}
	}
	/** @param {'accepted' | 'rejected' | 'none'} verdict */
	const judge = (verdict) => send({ verdict }, verdict === 'none' ? 'The verdict is taken back.' : `The track is ${verdict}.`);
	/** @param {EventKind} kind @param {boolean} added */
	const correct = (kind, added) => {
		const frame = added ? at : (eventAt(frames?.events ?? [], at)?.frame ?? at);
		send({ corrections: corrected(track.corrections, { frame, kind, added }) }, added ? `A ${kind} is added in frame ${frame}.` : `The ${kind} of frame ${frame} is removed.`);
	};
	const doing = useRef({ track, frames, at, goTo, judge, correct, zoom: (/** @type {number} */ by) => setWidth((before) => Math.min(Math.max(Math.round(before * by), 50), track.last - track.first + 1)) });
	Object.assign(doing.current, { track, frames, at, goTo, judge, correct });
	useKeys(useMemo(() => keysOfTrack(doing), [track.id]));
	const from = Math.min(Math.max(at - track.first - Math.floor(width / 2), 0), Math.max(track.last - track.first + 1 - width, 0));
	const part = useMemo(() => frames && partOf(frames, from, from + width - 1), [frames, from, width]);
	const charts = useMemo(() => part && chartsOf(part), [part]);
	if (found.error) return html`<${Trouble} title="Its frames cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (!frames || !part || !charts) return html`<${Loading} what="the track" />`;
	return html`
		<div class="track">
			<section class="card track__time" aria-label="The ball over time">
				<${Band} frames=${part} at=${at} goTo=${goTo} />
				${charts.map((chart) => html`<${Chart} key=${chart.yLabel} ...${chart} x=${part.frame} xLabel="frame" compact=${true} height=${HEIGHT} marker=${at} onPick=${(/** @type {number} */ index) => goTo(part.frame[index])} />`)}
				<p class="note">Frames ${part.frame[0]} to ${part.frame.at(-1)}. <kbd>+</kbd> <kbd>−</kbd> zoom at the frame, arrow keys move.</p>
				<${Numbers} x=${part.frame} xLabel="frame" curves=${charts.flatMap(({ curves }) => curves)} format=${centimetres} />
			</section>
			<div class="track__rail">
				<${FrameCard} track=${track} frames=${frames} at=${at} goTo=${goTo} />
				<${VerdictCard} track=${track} judge=${judge} />
				<${EventCard} frames=${frames} at=${at} goTo=${goTo} correct=${correct} />
			</div>
		</div>
	`;
}

export function TrackPage() {
	const id = 'track' in page.value ? page.value.track : 0;
	const found = useResource((signal) => getTrack(id, signal), [id]);
	const [changed, setChanged] = useState(/** @type {TrackJson | null} */ (null));
	const track = changed?.id === id ? changed : found.value;
	return html`
		<${PageFrame}
			current="tracks" title=${track ? `Track of ${track.key}` : 'Track'}
			where=${html`${track ? html`<strong>${track.dataset}</strong> <span class="header__place"><a href=${pageAddress(track.dataset, 'tracks')}>Tracks</a> / ${track.key}</span>` : null}`}
		>
			${found.error ? html`<${Trouble} title="This track cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${!track && !found.error ? html`<${Loading} what="the track" />` : null}
			${track?.summary.reason ? html`<section class="card empty" role="alert"><h2>This stretch has no track</h2><p>${track.summary.reason}</p><p>Annotate the ball in more of its frames, then make its track again.</p><p><a class="button" href=${pageAddress(track.dataset, 'tracks')}>Tracks of ${track.dataset}</a></p></section>` : null}
			${track && !track.summary.reason ? html`<${Track} key=${track.id} track=${track} setTrack=${setChanged} />` : null}
		<//>
	`;
}
