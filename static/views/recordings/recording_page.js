// @ts-check
/** One recording: its frames, its shots as a strip, and the instants that become groups. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useMemo, useRef } from 'preact/hooks';

import { getLinks, getRecording } from '../../api/recordings.js';
import { useKeys, useSize } from '../../lib/hooks.js';
import { address, navigate, page, param, place } from '../../lib/router.js';
import { useResource } from '../../lib/resource.js';
import { stored } from '../../lib/storage.js';
import { useDataset } from '../../state/datasets.js';
import { announce } from '../../state/notice.js';
import { goTo, openFilm, playTrouble, seen, showAt, speed, toggleRunning, wanted } from '../../state/playback.js';
import { makeShotList } from '../../state/shot_list.js';
import { clockOf, matchTime, shotAt, timecode } from '../../state/shots.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { useEnded, useRunningJobs } from '../running_jobs.js';
import { BallCard, BallOverlay } from './ball_card.js';
import { useBallKeys, useBalls } from './ball_state.js';
import { CameraCard } from './camera_card.js';
import { CameraCurves, CameraLines } from './camera_curves.js';
import { useCameraKeys, useCameras } from './camera_state.js';
import { ClockCard } from './clock_card.js';
import { InstantsCard } from './instants_card.js';
import { LinkCard } from './link_card.js';
import { keysOfRecording } from './recording_keys.js';
import { FindAgain, ShotCard } from './shot_card.js';
import { Strip } from './strip.js';
import { factsOf } from './recordings_page.js';

/** @import {RecordingJson} from '../../api/recordings.js' */
/** @import {Balls} from './ball_state.js' */
/** @import {Cameras} from './camera_state.js' */
/** @import {RunningJobs} from '../running_jobs.js' */

/** How long a frame is at hand before the address says so, milliseconds: browsers refuse an address that changes with every frame. */
const SETTLED = 300;
/** Frames that are chosen to become groups, by the id of their recording. */
const instants = stored('instants', /** @type {Record<string, number[]>} */ ({}), 'sessionStorage');

/** Which frames of a recording are chosen to become groups. @param {number} recording */
function useInstants(recording) {
	const frames = instants.value[recording];
	const chosen = useMemo(() => /** @type {ReadonlySet<number>} */ (new Set(frames)), [frames]);
	/** @param {number[]} next */
	const keep = (next) => {
		const { [recording]: _, ...rest } = instants.value;
		instants.value = next.length ? { ...rest, [recording]: next } : rest;
	};
	const present = () => new Set(instants.value[recording]);
	return {
		chosen,
		/** @param {number} frame */
		turn: (frame) => {
			const next = present();
			if (!next.delete(frame)) next.add(frame);
			announce(next.has(frame) ? `Frame ${frame} is chosen.` : `Frame ${frame} is no longer chosen.`);
			keep([...next]);
		},
		/** @param {number[]} more */
		add: (more) => keep([...new Set([...present(), ...more])]),
		clear: () => keep([]),
	};
}

/** Write the frame into the address while nothing plays, so that a reload and Back find it. @param {number} recording */
function useFrameInAddress(recording) {
	const [at, plays] = [wanted.value, speed.value !== 0];
	useLayoutEffect(() => {
		if (plays) return undefined;
		const timer = setTimeout(() => {
			const shown = page.peek();
			// The next page may be asked for and not yet drawn.
			if (shown.page !== 'recording' || shown.recording !== recording || param('frame') === String(at)) return;
			navigate(address(place.peek().path, { ...Object.fromEntries(place.peek().search), frame: String(at) }), { replace: true });
		}, SETTLED);
		return () => clearTimeout(timer);
	}, [at, plays]);
}

/** @param {{one: RecordingJson, seconds: (frame: number) => number, cameras: Cameras, balls: Balls}} props */
function Stage({ one, seconds, cameras, balls }) {
	const [ref, size] = useSize();
	useLayoutEffect(() => { if (size.width) showAt(size.width * Math.min(devicePixelRatio, 2)); }, [size.width]);
	const { frame, address } = seen.value;
	return html`
		<section class="film__stage" aria-label="Frame" data-frame=${frame}>
			<div class="film__picture" ref=${ref}>${address ? html`<img src=${address} alt=${`Frame ${frame} of ${one.name}`} />` : null}<${CameraLines} cameras=${cameras} /><${BallOverlay} one=${one} balls=${balls} cameras=${cameras} />${frame === wanted.value || playTrouble.value ? null : html`<p class="film__coming">Frame ${wanted.value} is loading.</p>`}</div>
			<p class="film__time">
				<button class="button" type="button" aria-pressed=${speed.value !== 0} onClick=${toggleRunning}>${speed.value ? 'Stop' : 'Play'} <kbd>Space</kbd></button>
				<strong class="mono" data-timecode>${timecode(seconds(wanted.value), one.fps ?? 25)}</strong>
				${one.clocks.length ? html`<span data-match-time>${matchTime(one.clocks, seconds, wanted.value)}</span>` : null}
				<span>frame ${wanted.value} of ${(one.frames ?? 1) - 1}</span>
				${Math.abs(speed.value) > 1 || speed.value < 0 ? html`<span>${speed.value} ×</span>` : null}
				${playTrouble.value ? html`<span class="form__error" role="alert">${playTrouble.value}</span>` : null}
			</p>
		</section>
	`;
}

/** @param {{one: RecordingJson, running: RunningJobs, reload: () => void}} props */
function Film({ one, running, reload }) {
	const shots = useMemo(() => makeShotList(one.id), [one.id]);
	const { read, change, undo, remember } = shots;
	const [list, error] = [shots.list.value, shots.error.value];
	useEffect(() => { read(); }, [read]);
	const chosen = useInstants(one.id);
	useFrameInAddress(one.id);
	const links = useResource((signal) => getLinks(one.id, signal), [one.id]).value?.items ?? [];
	useEffect(() => {
		const end = openFilm({ id: one.id, sha256: one.sha256, frames: one.frames ?? 0, fps: one.fps ?? 25 });
		// Whoever comes back from the lines of a frame is shown it again.
		if (Number(param('frame')) > 0) goTo(Number(param('frame')));
		return end;
	}, [one.id, one.sha256, one.frames]);
	useEnded(running.jobs, read);
	const doing = useRef({ change, undo, turn: chosen.turn });
	doing.current = { change, undo, turn: chosen.turn };
	const keys = useMemo(() => keysOfRecording(one, () => shots.list.value?.items ?? [], doing), [one.id]);
	useKeys(keys);
	const shot = list?.items[shotAt(list.items, wanted.value)];
	const cameras = useCameras(one, list?.items ?? [], shot, running);
	useCameraKeys(cameras);
	const balls = useBalls(one, shot);
	useBallKeys(balls);
	// Groups get the balls that are accepted.
	useEnded(running.jobs.filter(({ kind }) => kind === 'instants'), () => { reload(); balls.reload(); });
	if (error) {
		return html`
			<${Trouble} title="The shots cannot be shown" error=${error} retry=${read} />
			<section class="card" aria-label="Index"><${FindAgain} one=${one} running=${running} label="Index the recording again" over=${reload} /></section>
		`;
	}
	if (!list) return html`<${Loading} what="shots" />`;
	const at = shotAt(list.items, wanted.value);
	return html`
		<div class="film">
			<${Stage} one=${one} seconds=${clockOf(list.items, one.fps ?? 25)} cameras=${cameras} balls=${balls} />
			<div class="film__rail">
				<${ShotCard} one=${one} running=${running} shots=${list.items} at=${at} change=${change} remember=${remember} />
				<${BallCard} one=${one} shot=${shot} balls=${balls} />
				<${CameraCard} one=${one} cameras=${cameras} />
				<${LinkCard} one=${one} shots=${list.items} shot=${shot} links=${links} />
				<${InstantsCard} one=${one} running=${running} shot=${shot} instants=${chosen} links=${links} />
				<${ClockCard} one=${one} reload=${reload} />
			</div>
			<${Strip} one=${one} shots=${list.items} at=${at} chosen=${chosen.chosen} balls=${balls} goTo=${goTo} />
			<${CameraCurves} cameras=${cameras} />
		</div>
	`;
}

/** A recording, or why its frames cannot be read now. @param {{one: RecordingJson, reload: () => void}} props */
function Opened({ one, reload }) {
	const running = useRunningJobs({ dataset: one.dataset }, ({ subject }) => subject?.recording === one.id);
	const why = one.problem ?? (one.indexed ? null : 'It is not indexed yet.');
	if (!why) return html`<${Film} one=${one} running=${running} reload=${reload} />`;
	return html`<section class="card empty" role="alert"><h2>The frames cannot be read now</h2><p>${why}</p>${one.problem && one.indexed ? html`<p>Groups taken from it still work. Put the file back, or index it again as it is now; if the file is the same, its shots stay.</p>` : null}<${FindAgain} one=${one} running=${running} label="Index the recording again" over=${reload} /></section>`;
}

export function RecordingPage() {
	const id = 'recording' in page.value ? page.value.recording : 0;
	const found = useResource((signal) => getRecording(id, signal), [id]);
	// The answer of the recording before stays until this one's is there.
	const one = found.value?.id === id ? found.value : null;
	useEffect(() => { if (one) useDataset(one.dataset); }, [one?.dataset]);
	return html`
		<${PageFrame}
			current="recordings" title=${one ? one.name : 'Recording'}
			where=${html`<a href="/recordings">Recordings</a>${one ? html` / <strong>${one.name}</strong> <span class="film__facts">${factsOf(one)}</span>` : null}`}
		>
			${found.error ? html`<${Trouble} title="This recording cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${!one && !found.error ? html`<${Loading} what="the recording" />` : null}
			${one ? html`<${Opened} key=${one.id} one=${one} reload=${found.reload} />` : null}
		<//>
	`;
}
