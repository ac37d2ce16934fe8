// @ts-check
/** What the page of a recording knows of the cameras of the shot that is shown. */

import { useEffect, useRef, useState } from 'preact/hooks';

import { getCameraStretches, getFrameCameras, postCameras, turnCameras } from '../../api/cameras.js';
import { listen } from '../../api/events.js';
import { getPitches, setPitch } from '../../api/match_estimates.js';
import { postInstants } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { plural } from '../../lib/format.js';
import { useKeys } from '../../lib/hooks.js';
import { pitchSize } from '../../lib/pitch_size.js';
import { useResource } from '../../lib/resource.js';
import { address, navigate, page } from '../../lib/router.js';
import { worstFrame, nextUntracked } from '../../state/cameras.js';
import { isOver, jobToShow } from '../../state/jobs.js';
import { announce, explain, inform } from '../../state/notice.js';
import { goTo, wanted } from '../../state/playback.js';
import { useEnded } from '../running_jobs.js';

/** @import {FrameCamerasJson, ShotCamerasJson} from '../../api/cameras.js' */
/** @import {JobJson, JobSubject} from '../../api/jobs.js' */
/** @import {ApiError} from '../../api/problem.js' */
/** @import {RecordingJson, Shot} from '../../api/recordings.js' */
/** @import {Binding} from '../../lib/keys.js' */
/** @import {RunningJobs} from '../running_jobs.js' */

/**
 * @typedef {object} Cameras
 * @property {ShotCamerasJson | null} stretch that has the frame on screen
 * @property {FrameCamerasJson | null} frames of that stretch, as they are shown
 * @property {boolean} before whether those are shown that the present ones took the place of
 * @property {boolean} lines whether projected lines are drawn
 * @property {JobJson | null} job that tracks
 * @property {ApiError | null} error
 * @property {string} busy why nothing can be begun
 * @property {() => void} track
 * @property {number} missing shots of the main camera and replays without cameras
 * @property {() => void} trackAll of these
 * @property {() => void} correct draw the lines of the frame on screen
 * @property {() => void} turnHalf to the other side of the pitch, or back
 * @property {() => void} takePitch give the match the pitch that the frames show, and track again
 * @property {() => void} worst
 * @property {() => void} untracked
 * @property {() => void} turnBefore
 * @property {() => void} turnLines
 */

const NO_CAMERAS = 'This shot has no cameras yet.';
/** Shots that one press asks for: a person may have 24 jobs that wait, and needs some for other work. */
export const TOGETHER = 12;

/** Whether two share a frame. @param {JobSubject | {first: number, last: number} | null} a a job may say neither: it works on all @param {{first: number, last: number}} b */
const overlaps = (a, b) => (a?.first ?? 0) <= b.last && b.first <= (a?.last ?? Infinity);

/** @param {RecordingJson} one @param {Shot[]} shots @param {Shot | undefined} shot that is shown @param {RunningJobs} running on the recording @returns {Cameras} */
export function useCameras(one, shots, shot, { jobs, watch }) {
	const list = useResource((signal) => getCameraStretches(one.id, signal), [one.id]);
	const [before, setBefore] = useState(false);
	const [lines, setLines] = useState(true);
	const [drawing, setDrawing] = useState(-1);
	const { error, busy: asking, attempt } = useAttempt();
	const frame = wanted.value;
	const stretch = list.value?.items.find(({ first, last }) => first <= frame && frame <= last) ?? null;
	const old = before && stretch?.before !== null;
	const [id, revision] = [stretch?.first ?? -1, stretch?.revision ?? 0];
	const found = useResource(async (signal) => (id < 0 ? null : getFrameCameras(one.id, id, old, signal)), [one.id, id, revision, old]);
	const tracking = jobs.filter(({ kind }) => kind === 'track');
	// What is tracked as one is tracked again as one.
	const asked = shot && stretch && stretch.first <= shot.first && shot.last <= stretch.last ? stretch : shot;
	const here = tracking.filter(({ subject }) => asked && overlaps(subject, asked));
	// Of several the one that works on the shot on screen.
	const job = jobToShow(here.some((one) => !isOver(one)) || tracking.every(isOver) ? here : tracking);
	useEnded(tracking, list.reload);
	useEffect(() => listen('job', () => {}, list.reload), [one.id]);
	const busy = here.some((one) => !isOver(one)) ? 'A job is running on this shot' : jobs.some((one) => !isOver(one) && one.id === drawing) ? 'A job is running' : shot ? '' : 'This recording has no shot';
	const missing = shots.filter((shot) => (shot.kind === 'main' || shot.kind === 'replay') && shot.kept !== false
		&& !list.value?.items.some((item) => overlaps(item, shot)) && !tracking.some((job) => !isOver(job) && overlaps(job.subject, shot)));
	/** Whether nothing can be begun, which is said. */
	function isBusy() {
		if (busy) explain(`${busy}.`);
		return busy !== '';
	}
	function track() {
		if (isBusy() || !asked) return;
		attempt(postCameras(one.id, asked), async (begun) => {
			const over = await watch(begun);
			if (over.state === 'done') announce(over.sentence ?? 'The shot is tracked.');
		});
	}
	function trackAll() {
		if (asking) return;
		const some = missing.slice(0, TOGETHER);
		const rest = missing.length - some.length;
		const begin = async () => {
			for (const shot of some) watch(await postCameras(one.id, shot));
		};
		attempt(begin(), () => (rest
			? inform(`${some.length} of ${missing.length} shots will be tracked, one after the other. Press the button again when they are done.`)
			: announce(`${plural(some.length, 'shot')} will be tracked, one after the other.`)));
	}
	function turnHalf() {
		if (isBusy()) return;
		if (!stretch) { explain(NO_CAMERAS); return; }
		const turned = !stretch.summary.turned;
		attempt(turnCameras(one.id, stretch.first, turned), async (begun) => {
			const over = await watch(begun);
			if (over.state === 'done') announce(turned ? 'The cameras are on the other side of the pitch now. Shift T turns them back.' : 'The cameras are back on their first side.');
		});
	}
	function takePitch() {
		const other = stretch?.summary.pitch?.other;
		if (isBusy() || !other) return;
		// Both at once: whoever leaves the page meanwhile finds the shot tracked on its pitch.
		const size = getPitches(one.dataset).then(({ etag }) => setPitch(one.dataset, one.name, other, etag));
		attempt(size.then(() => postCameras(one.id, stretch)), async (begun) => {
			announce(`The pitch of this match is ${pitchSize(other)} now. The shot is tracked again on that pitch.`);
			const over = await watch(begun);
			if (over.state === 'done') announce(over.sentence ?? 'The shot is tracked.');
		});
	}
	function correct() {
		if (isBusy()) return;
		// Behind shots that are tracked it takes long, and the person does something else meanwhile.
		const waits = tracking.some((one) => !isOver(one));
		attempt(postInstants(one.id, [frame], { propose: false, linked: false }), async (begun) => {
			setDrawing(begun.id);
			const over = await watch(begun);
			if (over.state !== 'done') return;
			// Both ways back lead to this frame.
			const place = { frame: String(frame) };
			const open = () => navigate(address(`/review/${over.result.group}/calibration`, { recording: String(one.id), ...place }));
			const there = page.peek();
			if (waits || there.page !== 'recording' || there.recording !== one.id) {
				inform(`A group was made of frame ${frame} of ${one.name}.`, { label: 'Draw its lines', run: open });
				return;
			}
			navigate(address(`/recordings/${one.id}`, place), { replace: true });
			open();
		});
	}
	const frames = id < 0 || found.waiting && found.value?.first !== id ? null : found.value;
	/** @param {number | null | undefined} place @param {string} none @param {string} here where it is the frame on screen */
	const jump = (place, none, here) => {
		if (place === null || place === undefined) explain(none);
		else if (place === wanted.value) explain(here);
		else goTo(place);
	};
	return {
		stretch, frames, before: old, lines, job, error: error ?? found.error ?? list.error, busy, track, missing: list.value ? missing.length : 0, trackAll, correct, turnHalf, takePitch,
		worst: () => jump(frames && worstFrame(frames), 'No frame is tracked.', 'This is the worst frame.'),
		untracked: () => jump(frames && nextUntracked(frames, wanted.value), frames ? 'Every frame is tracked.' : NO_CAMERAS, 'No other frames of this shot are bridged or lost.'),
		turnBefore: () => {
			if (!stretch?.before) { explain('This shot has no previous cameras.'); return; }
			setBefore(!old);
			announce(old ? 'Showing the present cameras.' : 'Showing the previous cameras.');
		},
		turnLines: () => {
			setLines(!lines);
			announce(lines ? 'Projected lines are hidden.' : 'Projected lines are shown.');
		},
	};
}

/** @param {Cameras} cameras */
export function useCameraKeys(cameras) {
	const latest = useRef(cameras);
	latest.current = cameras;
	const keys = useRef(/** @type {Binding[]} */ ([
		{ keys: ['t'], label: 'Track the camera of the shot', group: 'Cameras', needs: 'lead', run: () => latest.current.track() },
		{ keys: ['Shift+t'], label: 'Turn the cameras to the other side of the pitch, or back', group: 'Cameras', needs: 'lead', run: () => latest.current.turnHalf() },
		{ keys: ['e'], label: 'Draw the lines of this frame', group: 'Cameras', needs: 'lead', run: () => latest.current.correct() },
		{ keys: ['w'], label: 'Worst frame of the shot', group: 'Cameras', run: () => latest.current.worst() },
		{ keys: ['n'], label: 'Next frame that is bridged or lost', group: 'Cameras', run: () => latest.current.untracked() },
		{ keys: ['b'], label: 'Show the cameras before the last change, or the present ones', group: 'Cameras', run: () => latest.current.turnBefore() },
		{ keys: ['p'], label: 'Projected lines', group: 'Cameras', run: () => latest.current.turnLines() },
	]));
	useKeys(keys.current);
}
