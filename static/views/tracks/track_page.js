// @ts-check
/** One track: its curves with their bands, its modes and events, and what is said of it. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from 'preact/hooks';

import { listenToGroups } from '../../api/events.js';
import { ApiError } from '../../api/problem.js';
import { getTrack, getTrackAround, getTrackFrames, patchTrack } from '../../api/tracks.js';
import { fixed, plural } from '../../lib/format.js';
import { useKeys } from '../../lib/hooks.js';
import { latest } from '../../lib/latest.js';
import { useResource } from '../../lib/resource.js';
import { address, navigate, page, param, place } from '../../lib/router.js';
import { stored } from '../../lib/storage.js';
import { useDataset } from '../../state/datasets.js';
import { me } from '../../state/me.js';
import { announce, complain, dismiss, explain, inform } from '../../state/notice.js';
import { listValues, nextOpen, trackAddress } from '../../state/track_list.js';
import { makeTrackPlayer, PACES } from '../../state/track_player.js';
import { amid, contradictedAfter, corrected, curvesOf, eventAt, EVENTS, forgetTrackChange, jumpText, lastTrackChange, MODES, mostShown, partOf, rememberTrack, runsOf, STATES, undoOfTrack } from '../../state/tracks.js';
import { Chart, Numbers } from '../chart.js';
import { pageAddress } from '../dataset_menu.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { ClickAgain } from './click_again.js';
import { EventCard } from './event_card.js';
import { keysOfTrack } from './track_keys.js';
import { TrackSpace } from './track_scene.js';
import { verdictText } from './tracks_page.js';

/** @import {Correction, EventKind, TrackAround, TrackFrames, TrackJson} from '../../api/tracks.js' */
/** @import {TrackPlayer} from '../../state/track_player.js' */
/** @import {Curve} from '../chart.js' */

const HEIGHT = 104;
/** Left-out error beyond which clicks alone are no reason, pixels. */
const CLICK_PX = 2;
/** Frames that are shown at first. */
const WINDOW = 500;
/** How long a frame is at hand before the address says so, milliseconds: browsers refuse an address that changes with every frame. */
const SETTLED = 300;
/** Changes of groups that come together are asked about once, and frames that somebody only passes are not, milliseconds. */
const [CHANGES, HELD] = [200, 40];
/** What the page shows of a track: its curves, or the ball in space. */
const shownAs = stored('track-view', /** @type {string} */ ('curves'));
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

/** Modes and states in proportion, and events above them; a click leads to its frame. @param {{frames: TrackFrames, at: number, goTo: (frame: number) => void, whole: boolean}} props `whole`: not as wide as charts below it */
function Band({ frames, at, goTo, whole }) {
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
	const jumps = frames.jumps.filter(({ frame }) => frame >= first && frame < first + total);
	const against = [...new Set(frames.contradicted.map(({ frame }) => frame))].filter((frame) => frame >= first && frame < first + total);
	const shown = at >= first && at < first + total;
	return html`
		<div class="track__band" data-whole=${whole} onClick=${click}>
			<ol class="track__events" aria-label="Events">
				${inside.map((event) => html`<li key=${`${event.frame} ${event.kind}`} style=${{ left: left(event.frame) }} data-kind=${event.kind} data-added=${event.added} title=${`${event.kind} in frame ${event.frame}`}><span class="hidden-text">${event.kind} in frame ${event.frame}</span><span aria-hidden="true">${EVENTS.find(({ kind }) => kind === event.kind)?.letter}</span></li>`)}
			</ol>
			${jumps.length ? html`<ol class="track__jumps" aria-label="Jumps where the views change">${jumps.map((jump) => html`<li key=${jump.frame} style=${{ left: left(jump.frame) }} title=${jumpText(jump)}><span class="hidden-text">${jumpText(jump)}</span><span aria-hidden="true">J</span></li>`)}</ol>` : null}
			${against.length ? html`<ol class="track__jumps" data-what="against" aria-label="Balls that contradict the track">${against.map((frame) => html`<li key=${frame} style=${{ left: left(frame) }} title=${`A ball contradicts the track in frame ${frame}`}><span class="hidden-text">frame ${frame}</span><span aria-hidden="true">!</span></li>`)}</ol>` : null}
			<ol class="track__modes" aria-label="What the ball does">
				${modes.map(({ value, from, to }) => html`<li key=${from} style=${{ flexGrow: to - from + 1 }} data-mode=${value || 'gap'} title=${`${MODES[value].name}: frames ${frames.frame[from]} to ${frames.frame[to]}`}><span class="hidden-text">${MODES[value].name}, frames ${frames.frame[from]} to ${frames.frame[to]}</span><span aria-hidden="true">${MODES[value].letter}</span></li>`)}
			</ol>
			<ol class="track__states" aria-label="How the position of the ball is known">
				${states.map(({ value, from, to }) => html`<li key=${from} style=${{ flexGrow: to - from + 1 }} data-state=${value} title=${STATES[value]}><span class="hidden-text">${STATES[value]}, frames ${frames.frame[from]} to ${frames.frame[to]}</span></li>`)}
			</ol>
			${shown ? html`<span class="film__head" style=${{ left: left(at) }}></span>` : null}
		</div>
	`;
}

/** What plays the track, and what of it is shown. @param {{player: TrackPlayer, switchView: () => void}} props */
function Tools({ player, switchView }) {
	const plays = player.speed.value !== 0;
	/** @param {Event} event */
	const choose = (event) => player.setPace(Number(/** @type {HTMLSelectElement} */ (event.currentTarget).value));
	const space = shownAs.value === 'space';
	return html`
		<div class="track__tools" role="toolbar" aria-label="Playing">
			<button class="button" type="button" aria-pressed=${plays} onClick=${player.toggle}>${plays ? 'Stop' : 'Play'} <kbd>Space</kbd></button>
			<label>Speed <select class="field" value=${String(player.pace.value)} onChange=${choose}>${PACES.map((pace) => html`<option key=${pace} value=${String(pace)}>${pace} ×</option>`)}</select></label>
			<span class="note">${plays ? `${player.speed.value < 0 ? 'backwards, ' : ''}${Math.abs(player.speed.value)} ×` : ''}</span>
			<span class="track__views" role="group" aria-label="What is shown">
				<button class="button" type="button" aria-pressed=${!space} onClick=${() => { if (space) switchView(); }}>Curves</button>
				<button class="button" type="button" aria-pressed=${space} onClick=${() => { if (!space) switchView(); }}>3D and top view</button>
				<kbd>\\</kbd>
			</span>
		</div>
	`;
}

/** @param {TrackFrames} frames @param {TrackAround | null} around what comes of some of them as their groups are now */
function chartsOf(frames, around) {
	const names = /** @type {const} */ (['x, m', 'y, m', 'height, m']);
	const charts = names.map((label, axis) => {
		const { values, low, high, raw } = curvesOf(frames, /** @type {0 | 1 | 2} */ (axis));
		const track = { label, values, low, high, gaps: true, colour: /** @type {const} */ ('chart-a') };
		const alone = { label: `${label.split(',')[0]} of each frame alone`, values: raw, colour: /** @type {const} */ ('chart-b'), points: 4 };
		const now = around && { label: 'with the present groups', values: amid(frames.frame, around, curvesOf(around, /** @type {0 | 1 | 2} */ (axis)).values), gaps: true, colour: /** @type {const} */ ('chart-c'), dash: [6, 4] };
		return { name: `${label} of the ball in each frame, with a band of two sigma`, yLabel: label, curves: /** @type {Curve[]} */ ([alone, track, ...(now ? [now] : [])]), format: centimetres };
	});
	const most = mostShown(frames.left_out_px);
	/** @type {Curve} */
	const left = { label: `left-out error, px (up to ${most})`, values: frames.left_out_px.map((value) => (value === null ? null : Math.min(value, most))), colour: 'chart-d', points: 4 };
	/** @type {Curve[]} */
	const now = around ? [{ label: 'with the present groups', values: amid(frames.frame, around, around.left_out_px).map((value) => (value === null ? null : Math.min(value, most))), colour: 'chart-c', points: 4 }] : [];
	return [...charts, { name: 'Error of left-out balls, by frame', yLabel: 'px', curves: [left, ...now], format: tenths, yRange: /** @type {[number | null, number | null]} */ ([0, null]) }];
}

/** What comes of the frame at hand as its groups are now. @param {{around: TrackAround, at: number}} props */
function Now({ around, at }) {
	const place = at - around.frame[0];
	const [x, y, z, left] = [around.x[place], around.y[place], around.z[place], around.left_out_px[place]];
	const where = typeof x === 'number' && typeof y === 'number' && typeof z === 'number' ? `x ${fixed(x, 2)}, y ${fixed(y, 2)}, height\u00a0${fixed(-z, 2)}\u00a0m` : null;
	return html`
		<div class="track__now" data-around=${at}>
			<p><strong>With the present groups:</strong> ${around.reason ?? where ?? 'not known'}${typeof left === 'number' ? `, left-out error ${fixed(left, 1)} px` : ''}.</p>
			<p class="note">Dashed in the curves, frames ${around.frame[0]} to ${around.frame.at(-1)}. The saved track stays as it is until it is recomputed.</p>
		</div>
	`;
}

/** What is known of the frame at hand. @param {{track: TrackJson, frames: TrackFrames, around: TrackAround | null, at: number, goTo: (frame: number) => void}} props */
function FrameCard({ track, frames, around, at, goTo }) {
	const place = at - track.first;
	const [x, y, z, sigma] = [frames.x[place], frames.y[place], frames.z[place], frames.sigma[place]];
	const velocity = frames.velocity[place];
	const group = frames.group[place];
	const against = frames.contradicted.filter(({ frame }) => frame === at);
	const event = eventAt(frames.events, at);
	const jump = frames.jumps.find(({ frame }) => frame === at);
	const { worst } = track.summary;
	return html`
		<section class="card" aria-labelledby="frame-title" data-frame=${at}>
			<h2 id="frame-title">Frame ${at} <small>${frames.time_s[place].toFixed(2)} s</small></h2>
			<dl class="facts">
				<dt>Ball</dt><dd>${x === null || y === null || z === null ? 'not known' : `x ${fixed(x, 2)}, y ${fixed(y, 2)}, height\u00a0${fixed(-z, 2)}\u00a0m`}</dd>
				<dt>Sigma</dt><dd>${sigma === null ? '–' : `${fixed(sigma, 2)} m`}</dd>
				<dt>Speed</dt><dd>${velocity ? `${fixed(3.6 * Math.hypot(...velocity), 0)} km/h` : '–'}</dd>
				<dt>Source</dt><dd>${STATES[frames.state[place]]}${frames.views[place].length ? ` (${frames.views[place].join(', ')})` : ''}</dd>
				<dt>Motion</dt><dd>${MODES[frames.mode[place]].name}${event ? `; ${event.kind} in frame ${event.frame}` : ''}</dd>
				${jump ? html`<dt>Jump</dt><dd>${jumpText(jump)}</dd>` : null}
				<dt>Left-out error</dt><dd>${frames.left_out_px[place] === null ? '–' : `${fixed(frames.left_out_px[place], 1)} px`}</dd>
			</dl>
			${against.map((one) => html`<div class="track__against" key=${one.view}><p><strong>${one.view}</strong> is ${fixed(one.px, 0)} px off. ${one.sentence}</p><p class="note">${one.fix}</p>${one.group === null ? html`<${ClickAgain} track=${track} view=${one.view} frame=${at} />` : null}</div>`)}
			${around ? html`<${Now} around=${around} at=${at} />` : null}
			<p class="buttons">
				${group === null ? html`<button class="button" type="button" aria-disabled="true" title="No group shows this frame">Open the group</button>` : html`<a class="button" href=${`/review/${group}`}>Open the group <kbd>Enter</kbd></a>`}
				${worst === null ? null : html`<button class="button" type="button" title="The frame with the largest left-out error" onClick=${() => goTo(worst)}>Worst frame <kbd>W</kbd></button>`}
			</p>
		</section>
	`;
}

/** @param {{track: TrackJson, frames: TrackFrames, judge: (verdict: 'accepted' | 'rejected' | 'none') => void, toContradicted: () => void}} props */
function VerdictCard({ track, frames, judge, toContradicted }) {
	const { summary } = track;
	const alone = frames.contradicted.filter(({ group }) => group === null).length;
	const why = track.stale ? 'Its groups have changed: recompute the track first' : '';
	/** @param {'accepted' | 'rejected'} verdict */
	const press = (verdict) => judge(track.verdict === verdict ? 'none' : verdict);
	return html`
		<section class="card" aria-labelledby="track-title">
			<h2 id="track-title">Track</h2>
			<p>${verdictText(track)}${track.judged_by && track.verdict ? html` by ${track.judged_by}` : null}</p>
			<p class="note">${summary.median_px === null ? 'No ball could be left out to measure the error' : `Error of left-out balls: median ${fixed(summary.median_px, 1)} px, 95 % within ${fixed(summary.p95_px, 1)} px`}. Made from ${plural(summary.measurements, 'ball')} of all views${summary.contradicted ? html`; <button class="link-button" type="button" title="The next frame with a ball that contradicts the track (c)" onClick=${toContradicted}>${summary.contradicted} ${summary.contradicted === 1 ? 'contradicts' : 'contradict'} the track</button>${alone ? `, ${alone} in frames without a group` : ''}` : null}.</p>
			${(summary.median_px ?? 0) > CLICK_PX ? html`<p class="note">Left-out balls are predicted less exactly than a click: the cameras contradict each other. An adjustment to lines and balls (<code>touchline rig</code>) may bring them together.</p>` : null}
			<p class="buttons">
				<button class="button" type="button" data-needs="review" data-of=${track.dataset} aria-pressed=${track.verdict === 'accepted'} aria-disabled=${why !== ''} title=${why} onClick=${() => { if (!why) press('accepted'); }}>Accept <kbd>A</kbd></button>
				<button class="button" type="button" data-needs="review" data-of=${track.dataset} aria-pressed=${track.verdict === 'rejected'} onClick=${() => press('rejected')}>Reject <kbd>X</kbd></button>
			</p>
			${track.stale ? html`<p class="note">${why}: <a class="link" href=${pageAddress(track.dataset, 'tracks')}>tracks of ${track.dataset}</a>.</p>` : null}
		</section>
	`;
}

/** Read the track again where groups of its dataset were changed; counts how often. @param {TrackJson} track @param {(track: TrackJson) => void} setTrack */
function useChanges({ id, dataset }, setTrack) {
	const [turn, setTurn] = useState(0);
	useEffect(() => {
		const again = latest(CHANGES, async (_, signal) => {
			// What cannot be read now is read with the next change.
			const found = await getTrack(id, signal).catch((error) => { if (error instanceof ApiError) return null; throw error; });
			if (found) setTrack(found);
			setTurn((before) => before + 1);
		});
		const deaf = listenToGroups((/** @type {{dataset: string}} */ event) => { if (event.dataset === dataset) again.run(null); }, () => again.run(null));
		return () => { deaf(); again.cancel(); };
	}, [id, dataset]);
	return turn;
}

/** What comes of the frames around one, where groups have changed since the track was made. @param {TrackJson} track @param {number} at @param {boolean} plays @param {number} turn @returns {TrackAround | null} */
function useAround({ id, stale, etag }, at, plays, turn) {
	const wanted = stale && !plays;
	const found = useResource(async (signal) => {
		// Who holds an arrow key down asks once.
		await new Promise((resolve) => { setTimeout(resolve, HELD); });
		return wanted && !signal.aborted ? getTrackAround(id, at, signal) : null;
	}, [id, wanted, etag, at, turn]);
	return wanted && found.value?.frame.includes(at) ? found.value : null;
}

/** @param {{track: TrackJson, setTrack: (track: TrackJson) => void}} props */
function Track({ track, setTrack }) {
	const found = useResource((signal) => framesOf(track, signal), [track.id, track.etag]);
	const player = useMemo(() => {
		const made = makeTrackPlayer({ first: track.first, last: track.last, rate: track.summary.rate });
		made.goTo(Number(param('frame')) || (track.summary.worst ?? track.first));
		return made;
	}, [track.id]);
	const [at, plays] = [player.at.value, player.speed.value !== 0];
	const [width, setWidth] = useState(Math.min(track.last - track.first + 1, WINDOW));
	const turn = useChanges(track, setTrack);
	const newest = useRef(track);
	useLayoutEffect(() => { newest.current = track; }, [track]);
	const sending = useRef(Promise.resolve());
	const judging = useRef(false);
	const isHere = () => { const at = page.peek(); return at.page === 'track' && at.track === track.id; };
	const frames = found.value;
	const goTo = player.goTo;
	const switchView = () => { shownAs.value = shownAs.value === 'space' ? 'curves' : 'space'; };
	useEffect(() => () => player.stand(), [player]);
	// A layout effect: others are cleaned up after the next page is painted, whose address would get the frame.
	useLayoutEffect(() => {
		if (plays) return undefined;
		const timer = setTimeout(() => {
			// The next page may be asked for and not yet drawn: its address says another frame.
			if (!isHere()) return;
			const values = { ...Object.fromEntries(place.peek().search), frame: String(at) };
			navigate(address(place.peek().path, values), { replace: true });
		}, SETTLED);
		return () => clearTimeout(timer);
	}, [at, plays]);
	/** To the next track that waits for a verdict, in the list that this one was reached from. @param {() => boolean} [stillWanted] asked once it is known which track that is */
	async function goOn(stillWanted = () => true) {
		const values = listValues(place.peek().search);
		/** @type {Awaited<ReturnType<typeof nextOpen>>} */
		let next;
		try {
			next = await nextOpen(track, values, me.value?.name ?? 'local');
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			complain(`The next track is not known: ${problem.message}`);
			return;
		}
		if (!isHere() || !stillWanted()) return;
		if (!next) inform('No other track of this list waits for a verdict.', { label: 'All tracks', run: () => navigate(pageAddress(track.dataset, 'tracks')) });
		else navigate(trackAddress(next.id, values));
	}
	/** @param {TrackJson} changed */
	function keep(changed) {
		newest.current = changed;
		if (isHere()) setTrack(changed);
	}
	/** @param {(present: TrackJson) => Parameters<typeof patchTrack>[1]} make of the last answer @param {string} told @returns {Promise<boolean>} whether it is saved */
	async function sendNow(make, told) {
		try {
			const before = newest.current;
			const after = await patchTrack(before, make(before));
			keep(after);
			rememberTrack(before, after);
			// A notice that no track waits for a verdict is no longer true.
			if (!after.verdict) dismiss();
			announce(told);
			return true;
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			complain(problem.message);
			if (problem.status === 412) await readAgain();
			return false;
		}
	}
	async function readAgain() {
		try {
			keep(await getTrack(track.id));
		} catch (problem) {
			// Why it was not saved is told already.
			if (!(problem instanceof ApiError)) throw problem;
		}
	}
	/** One after the other: each builds on the last answer. @param {Parameters<typeof sendNow>} what */
	function send(...what) {
		const sent = sending.current.then(() => sendNow(...what));
		sending.current = sent.then(() => {});
		return sent;
	}
	/** @param {Correction} one */
	const restore = (one) => { if (isHere()) send((present) => ({ corrections: present.corrections.filter((other) => other.added || other.frame !== one.frame || other.kind !== one.kind) }), `Restored the ${one.kind} of frame ${one.frame}.`); };
	/** @param {'accepted' | 'rejected' | 'none'} verdict */
	async function judge(verdict) {
		if (judging.current || !isHere()) return;
		judging.current = true;
		const saved = await send(() => ({ verdict }), verdict === 'none' ? 'The verdict is withdrawn.' : `The track is ${verdict}.`);
		judging.current = false;
		// Who takes it back meanwhile stays.
		if (saved && verdict !== 'none' && isHere()) await goOn(() => !judging.current && newest.current.verdict === verdict);
	}
	/** Take the last verdict or correction back, also that of the track before, which is shown then. */
	async function undoNow() {
		if (!isHere()) return;
		const change = lastTrackChange(track.dataset);
		if (!change) { explain('There is nothing to undo.'); return; }
		try {
			const present = change.track === track.id ? newest.current : await getTrack(change.track);
			const body = undoOfTrack(change, present);
			if (body) keepUndone(await patchTrack(present, body));
			else complain(`The track ${present.key} was changed after that, so it is not undone.`);
			forgetTrackChange(change);
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			complain(`It is not undone: ${problem.message}`);
			if (!problem.isPassing) forgetTrackChange(change);
			if (problem.status === 412) await readAgain();
		}
	}
	/** @param {TrackJson} undone */
	function keepUndone(undone) {
		announce('Undone.');
		if (undone.id === track.id) keep(undone);
		else if (isHere()) navigate(trackAddress(undone.id, listValues(place.peek().search)));
	}
	const undo = () => { sending.current = sending.current.then(undoNow); };
	/** @param {EventKind} kind @param {boolean} added */
	const correct = (kind, added) => {
		if (!isHere()) return;
		const frame = added ? at : (eventAt(frames?.events ?? [], at)?.frame ?? at);
		send((present) => ({ corrections: corrected(present.corrections, { frame, kind, added }) }), added ? `Added a ${kind} in frame ${frame}.` : `Removed the ${kind} of frame ${frame}.`);
	};
	const doing = useRef({ track, frames, at, player, judge, correct, undo, switchView, goOn, zoom: (/** @type {number} */ by) => setWidth((before) => Math.min(Math.max(Math.round(before * by), 50), track.last - track.first + 1)) });
	Object.assign(doing.current, { track, frames, at, player, judge, correct, undo, goOn });
	useKeys(useMemo(() => keysOfTrack(doing), [track.id]));
	const from = Math.min(Math.max(at - track.first - Math.floor(width / 2), 0), Math.max(track.last - track.first + 1 - width, 0));
	const part = useMemo(() => frames && partOf(frames, from, from + width - 1), [frames, from, width]);
	const space = shownAs.value === 'space';
	const around = useAround(track, at, plays, turn);
	const charts = useMemo(() => (part && !space ? chartsOf(part, around) : null), [part, space, around]);
	if (found.error) return html`<${Trouble} title="Its frames cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (!frames || !part) return html`<${Loading} what="the track" />`;
	return html`
		<div class="track">
			<section class="card track__time" aria-label="The ball over time">
				<${Tools} player=${player} switchView=${switchView} />
				<${Band} frames=${space ? frames : part} at=${at} goTo=${goTo} whole=${space} />
				${space ? html`<${TrackSpace} track=${track} frames=${frames} at=${at} plays=${plays} leave=${switchView} />` : null}
				${charts?.map((chart) => html`<${Chart} key=${chart.yLabel} ...${chart} x=${part.frame} xLabel="frame" compact=${true} height=${HEIGHT} marker=${at} onPick=${(/** @type {number} */ index) => goTo(part.frame[index])} />`)}
				${charts ? html`
					<p class="note">Frames ${part.frame[0]} to ${part.frame.at(-1)}. <kbd>+</kbd> <kbd>−</kbd> zoom at the frame, arrow keys move.</p>
					<${Numbers} x=${part.frame} xLabel="frame" curves=${charts.flatMap(({ curves }) => curves)} format=${centimetres} />` : null}
			</section>
			<div class="track__rail">
				<${FrameCard} track=${track} frames=${frames} around=${around} at=${at} goTo=${goTo} />
				<${VerdictCard} track=${track} frames=${frames} judge=${judge} toContradicted=${() => { const frame = contradictedAfter(frames.contradicted, at); if (frame !== undefined) goTo(frame); }} />
				<${EventCard} frames=${frames} removed=${track.corrections.filter(({ added }) => !added)} at=${at} goTo=${goTo} correct=${correct} restore=${restore} />
			</div>
		</div>
	`;
}

export function TrackPage() {
	const id = 'track' in page.value ? page.value.track : 0;
	const found = useResource((signal) => getTrack(id, signal), [id]);
	const [changed, setChanged] = useState(/** @type {TrackJson | null} */ (null));
	// What was changed is older than what is read when somebody comes back.
	useEffect(() => setChanged(null), [id]);
	// The answer about the track before stays until the next one is there: no key may act on it.
	const track = [changed, found.value].find((one) => one?.id === id) ?? null;
	useEffect(() => { if (track) useDataset(track.dataset); }, [track?.dataset]);
	return html`
		<${PageFrame}
			current="tracks" title=${track ? `Track of ${track.key}` : 'Track'}
			where=${html`${track ? html`<strong>${track.dataset}</strong> <span class="header__place"><a href=${pageAddress(track.dataset, 'tracks')}>Tracks</a> / ${track.key}</span>` : null}`}
		>
			${found.error ? html`<${Trouble} title="This track cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${!track && !found.error ? html`<${Loading} what="the track" />` : null}
			${track?.summary.reason ? html`<section class="card empty" role="alert"><h2>This stretch has no track</h2><p>${track.summary.reason}</p><p>Annotate the ball in more of its frames, then recompute the track.</p><p><a class="button" href=${pageAddress(track.dataset, 'tracks')}>Tracks of ${track.dataset}</a></p></section>` : null}
			${track && !track.summary.reason ? html`<${Track} key=${track.id} track=${track} setTrack=${setChanged} />` : null}
		<//>
	`;
}
