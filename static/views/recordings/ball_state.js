// @ts-check
/** What the page of a recording knows of the balls that were followed in the shot on screen. */

import { useEffect, useRef, useState } from 'preact/hooks';

import { deleteBallRun, getBallRun, getBallRuns, patchBallRun, postBallClick, postBallRun } from '../../api/ball_runs.js';
import { useAttempt } from '../../lib/attempt.js';
import { useKeys } from '../../lib/hooks.js';
import { written } from '../../lib/keys.js';
import { useResource } from '../../lib/resource.js';
import { plural } from '../../lib/format.js';
import { nextUncertain, runAt, uncertainAround } from '../../state/ball_runs.js';
import { announce, explain } from '../../state/notice.js';
import { goTo, stand, wanted } from '../../state/playback.js';

/** @import {BallRunFrames, BallRunJson} from '../../api/ball_runs.js' */
/** @import {ApiError} from '../../api/problem.js' */
/** @import {RecordingJson, Shot} from '../../api/recordings.js' */
/** @import {Binding} from '../../lib/keys.js' */

/** @typedef {{x: number, y: number}} Place   pixels of the recording */
/**
 * @typedef {object} Balls
 * @property {BallRunJson[]} all runs of the recording
 * @property {BallRunFrames[]} runs of the shot, with their frames
 * @property {BallRunFrames | null} run at the frame on screen
 * @property {Place | null} cross where Enter clicks; null while nobody clicks by keyboard
 * @property {boolean} busy whether a ball is being followed
 * @property {ApiError | null} error
 * @property {(at: Place, frame?: number) => void} click of the frame on screen, if none is named
 * @property {() => void} accept
 * @property {() => void} takeBack
 * @property {() => void} confirm
 * @property {() => void} next
 * @property {string} question whether the run shall be deleted, which has been asked; '' if not
 * @property {() => void} remove the run; one that is accepted or has several clicks when it is asked again
 * @property {() => void} keep forget the question
 * @property {() => void} reload
 * @property {() => void} turnCross
 * @property {(x: number, y: number, event: KeyboardEvent) => void} moveCross
 */

/** Until it is asked again what came of a click that is being followed, ms. */
const ASK_AGAIN = 700;
/** What one press of an arrow moves the cross by, pixels of the recording. */
const STEPS = { plain: 8, Shift: 40, Alt: 1 };

const BUSY = 'The ball is being followed.';
const NONE = 'No ball is followed in this frame.';
/** Said of an accepted ball that no group has. */
export const NO_VIEW = 'No group has these frames yet. Make groups of them: they get the ball.';

/** @param {BallRunJson} run */
const tag = ({ id, etag }) => `${id} ${etag}`;

/** @param {RecordingJson} one @param {Shot | undefined} shot @returns {Balls} */
export function useBalls(one, shot) {
	const list = useResource((signal) => getBallRuns(one.id, signal), [one.id]);
	const [cross, setCross] = useState(/** @type {Place | null} */ (null));
	const [doomed, setDoomed] = useState('');
	const { error, busy: asking, attempt } = useAttempt();
	const known = useRef(/** @type {Map<string, BallRunFrames>} */ (new Map()));
	const all = list.value?.items ?? [];
	const mine = shot ? all.filter(({ first, last }) => first <= shot.last && shot.first <= last) : [];
	const asked = mine.map(tag).join();
	const read = useResource(async (signal) => {
		for (const run of mine) {
			if (!known.current.has(tag(run))) known.current.set(tag(run), await getBallRun(one.id, run.id, signal));
		}
		return asked;
	}, [one.id, asked]);
	const runs = mine.flatMap((run) => known.current.get(tag(run)) ?? []);
	const frame = wanted.value;
	const run = runAt(runs, frame);
	useEffect(() => { setCross(null); }, [one.id]);
	useEffect(() => { setDoomed(''); }, [frame]);
	// Begun before the page was opened, or by somebody else.
	const elsewhere = list.value?.following ?? [];
	useEffect(() => {
		if (asking || !elsewhere.length) return undefined;
		const timer = setTimeout(list.reload, ASK_AGAIN);
		return () => clearTimeout(timer);
	}, [list.value, asking]);
	const busy = asking || elsewhere.some((click) => shot && shot.first <= click && click <= shot.last);
	/** @param {Promise<BallRunFrames>} doing @param {(done: BallRunFrames) => string} told */
	const ask = (doing, told) => attempt(doing, (done) => {
		known.current.set(tag(done), done);
		list.reload();
		announce(told(done));
	});
	/** @param {Place} at @param {number} [where] */
	function click(at, where = frame) {
		if (busy) explain(BUSY);
		if (busy || list.waiting) return;
		stand();
		// A picture that is behind what is wanted is the one that was clicked.
		if (where !== frame) goTo(where);
		if (shot && (where < shot.first || where > shot.last)) { explain('This frame is of another shot: click the ball again.'); return; }
		const said = { frame: where, x: at.x, y: at.y };
		setCross(null);
		const there = runAt(runs, where);
		const open = there && !there.accepted_by ? there : null;
		ask(open ? postBallClick(one.id, open, said) : postBallRun(one.id, said), ({ first, last, uncertain }) => (
			`The ball is followed from frame ${first} to ${last}; ${uncertain ? `${plural(uncertain, 'frame')} uncertain` : 'no frame is uncertain'}.`
		));
	}
	/** @param {boolean} accepted */
	function decide(accepted) {
		if (busy) explain(BUSY);
		else if (!run) explain(NONE);
		else if (Boolean(run.accepted_by) === accepted) explain(accepted ? 'This ball has been accepted already.' : 'Nothing to withdraw: this ball has not been accepted.');
		else ask(patchBallRun(one.id, run, { accepted }), ({ placed, kept, refused }) => (accepted
			? !placed && !kept && !refused ? `Accepted. ${NO_VIEW}` : `Accepted: the ball was added to ${plural(placed ?? 0, 'view')}${kept ? `; ${plural(kept, 'view')} already had one` : ''}${refused ? `; ${plural(refused, 'view')} could not be edited` : ''}.`
			: refused ? `Not withdrawn: ${plural(refused, 'view')} could not be edited. Withdraw it again.` : 'Withdrawn: the balls that accepting added are removed.'));
	}
	function confirm() {
		const around = run ? uncertainAround(run, frame) : [];
		if (busy) explain(BUSY);
		else if (!run) explain(NONE);
		else if (!around.length) explain('There is nothing to confirm at this frame.');
		else ask(patchBallRun(one.id, run, { confirmed: [...run.confirmed, ...around] }), () => `${plural(around.length, 'frame')} confirmed.`);
	}
	// What a person has said of it.
	const worth = run && (run.accepted_by ? 'Delete the accepted ball?' : run.clicks.length > 1 || run.confirmed.length ? 'Delete the corrected ball?' : '');
	function remove() {
		if (busy) explain(BUSY);
		else if (!run) explain(NONE);
		else if (worth && doomed !== tag(run)) {
			setDoomed(tag(run));
			explain('Press Delete again to delete this ball. It cannot be undone.');
		} else attempt(deleteBallRun(one.id, run.id), () => { list.reload(); announce('The followed ball is deleted.'); });
	}
	function next() {
		const place = nextUncertain(runs, frame);
		if (place === null) explain(runs.length ? 'No frame is uncertain.' : 'No ball is followed in this shot.');
		else if (place === frame) explain('No other frame is uncertain.');
		else goTo(place);
	}
	const middle = { x: (one.width ?? 0) / 2, y: (one.height ?? 0) / 2 };
	return {
		all, runs, run, cross, busy, error: error ?? list.error ?? read.error, click, confirm, next, remove,
		question: run && worth && doomed === tag(run) ? worth : '',
		keep: () => setDoomed(''),
		reload: list.reload,
		accept: () => decide(true),
		takeBack: () => decide(false),
		turnCross: () => { stand(); setCross(cross ? null : middle); },
		moveCross: (x, y, { shiftKey, altKey }) => {
			const step = altKey ? STEPS.Alt : shiftKey ? STEPS.Shift : STEPS.plain;
			/** @param {number} value @param {number | null} size */
			const inside = (value, size) => Math.min(Math.max(value, 0), (size ?? 1) - 1);
			if (cross) setCross({ x: inside(cross.x + x * step, one.width), y: inside(cross.y + y * step, one.height) });
		},
	};
}

/** @param {Balls} balls */
export function useBallKeys(balls) {
	const latest = useRef(balls);
	latest.current = balls;
	const keys = useRef(/** @type {Binding[]} */ ([
		{ keys: ['f'], label: 'Show a cross to click the ball by keyboard; arrow keys move it', group: 'Ball', needs: 'annotate', run: () => latest.current.turnCross() },
		{ keys: ['y'], label: 'Accept the followed ball', group: 'Ball', needs: 'annotate', run: () => latest.current.accept() },
		{ keys: ['u'], label: 'Withdraw the acceptance', group: 'Ball', needs: 'annotate', run: () => latest.current.takeBack() },
		{ keys: ['v'], label: 'Next uncertain or lost frame', group: 'Ball', run: () => latest.current.next() },
		{ keys: ['o'], label: 'Confirm these uncertain frames', group: 'Ball', needs: 'annotate', run: () => latest.current.confirm() },
		{ keys: ['Delete'], label: 'Delete the followed ball', group: 'Ball', needs: 'annotate', run: () => latest.current.remove() },
	]));
	useKeys(keys.current);
	const crossed = useRef(/** @type {Binding[]} */ (crossKeys(latest)));
	useKeys(crossed.current);
}

/** @param {{current: Balls}} latest @returns {Binding[]} */
function crossKeys(latest) {
	const when = () => latest.current.cross !== null;
	const ways = /** @type {const} */ ([['ArrowLeft', -1, 0], ['ArrowRight', 1, 0], ['ArrowUp', 0, -1], ['ArrowDown', 0, 1]]);
	return [
		...ways.map(([key, x, y]) => /** @type {Binding} */ ({
			keys: [key, `Shift+${key}`, `Alt+${key}`], label: `Move the cross ${key.slice(5).toLowerCase()}; with Shift further, with Alt by one pixel`, group: 'Ball, with the cross', shown: written(key), when, repeats: true, run: (event) => latest.current.moveCross(x, y, event),
		})),
		{ keys: ['Enter'], label: 'Follow the ball from the cross', group: 'Ball, with the cross', when, run: () => { const { cross, click } = latest.current; if (cross) click(cross); } },
		{ keys: ['Escape'], label: 'Hide the cross', group: 'Ball, with the cross', when, run: () => latest.current.turnCross() },
	];
}
