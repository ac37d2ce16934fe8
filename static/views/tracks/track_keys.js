// @ts-check
/** Keys of the page of a track. */

import { navigate } from '../../lib/router.js';
import { explain } from '../../state/notice.js';
import { contradictedAfter, eventAt, eventBy, EVENTS } from '../../state/tracks.js';

/** @import {EventKind, TrackFrames, TrackJson} from '../../api/tracks.js' */
/** @import {Binding} from '../../lib/keys.js' */
/** @import {TrackPlayer} from '../../state/track_player.js' */

/**
 * @typedef {object} Doing
 * @property {TrackJson} track
 * @property {TrackFrames | null} frames
 * @property {number} at
 * @property {TrackPlayer} player
 * @property {(verdict: 'accepted' | 'rejected' | 'none') => void} judge
 * @property {(kind: EventKind, added: boolean) => void} correct
 * @property {() => void} undo
 * @property {(by: number) => void} zoom
 * @property {() => void} switchView
 * @property {() => Promise<void>} goOn
 */

/** @param {{current: Doing}} doing as it is when a key is pressed @returns {Binding[]} */
export function keysOfTrack(doing) {
	const [look, say] = ['Track', 'Verdict and events'];
	/** @param {number} step */
	const stepBy = (step) => doing.current.player.stepBy(step);
	/** @param {number} frame */
	const goTo = (frame) => doing.current.player.goTo(frame);
	/** @param {1 | -1} way */
	const toEvent = (way) => {
		const next = eventBy(doing.current.frames?.events ?? [], doing.current.at, way);
		if (next) goTo(next.frame);
		else explain(`No event comes ${way > 0 ? 'after' : 'before'} this frame.`);
	};
	const second = () => Math.round(doing.current.track.summary.rate);
	return [
		{ keys: [' '], label: 'Play or stop', group: look, shown: 'Space', run: () => doing.current.player.toggle() },
		{ keys: ['l'], label: 'Play forwards; press again to double the speed', group: look, run: () => doing.current.player.run(1) },
		{ keys: ['k'], label: 'Stop', group: look, run: () => doing.current.player.stand() },
		{ keys: ['j'], label: 'Play backwards; press again to double the speed', group: look, run: () => doing.current.player.run(-1) },
		{ keys: [','], label: 'Play more slowly', group: look, run: () => doing.current.player.changePace(-1) },
		{ keys: ['.'], label: 'Play faster', group: look, run: () => doing.current.player.changePace(1) },
		{ keys: ['\\'], label: '3D and top view, or the curves', group: look, run: () => doing.current.switchView() },
		{ keys: ['ArrowRight'], label: 'Next frame', group: look, repeats: true, run: () => stepBy(1) },
		{ keys: ['ArrowLeft'], label: 'Previous frame', group: look, repeats: true, run: () => stepBy(-1) },
		{ keys: ['Shift+ArrowRight'], label: 'One second forward', group: look, repeats: true, run: () => stepBy(second()) },
		{ keys: ['Shift+ArrowLeft'], label: 'One second back', group: look, repeats: true, run: () => stepBy(-second()) },
		{ keys: ['n'], label: 'Next event', group: look, repeats: true, run: () => toEvent(1) },
		{ keys: ['p'], label: 'Previous event', group: look, repeats: true, run: () => toEvent(-1) },
		{ keys: ['w'], label: 'Worst frame: the largest left-out error', group: look, run: () => { const { worst } = doing.current.track.summary; if (worst !== null) goTo(worst); else explain('No ball was left out to measure the error.'); } },
		{ keys: ['c'], label: 'Next frame with a ball that contradicts the track', group: look, run: () => {
			const { frames, at } = doing.current;
			const frame = contradictedAfter(frames?.contradicted ?? [], at);
			if (frame === undefined) explain('No ball contradicts the track.');
			else if (frame === at) explain('No other frame has a ball that contradicts the track.');
			else goTo(frame);
		} },
		{ keys: ['+', '='], label: 'Show fewer frames', group: look, shown: '+', repeats: true, run: () => doing.current.zoom(0.5) },
		{ keys: ['-'], label: 'Show more frames', group: look, repeats: true, run: () => doing.current.zoom(2) },
		{ keys: ['Enter'], label: 'Open the group of this frame', group: look, run: () => {
			const { frames, track, at } = doing.current;
			const group = frames?.group[at - track.first];
			if (group) navigate(`/review/${group}`);
			else explain('This frame has no group.');
		} },
		{ keys: ['a'], label: 'Accept the track, and go to the next one', group: say, needs: 'review', run: () => doing.current.judge('accepted') },
		{ keys: ['x'], label: 'Reject the track, and go to the next one', group: say, needs: 'review', run: () => doing.current.judge('rejected') },
		{ keys: ['u'], label: 'Withdraw the verdict', group: say, needs: 'review', run: () => doing.current.judge('none') },
		{ keys: ['f'], label: 'Next track that waits for a verdict', group: say, run: () => { doing.current.goOn(); } },
		...EVENTS.map(({ kind, key }) => /** @type {Binding} */ ({ keys: [key], label: kind === 'out' ? 'Mark the ball out of play at this frame' : `Add a ${kind} at this frame`, group: say, needs: 'review', run: () => doing.current.correct(kind, true) })),
		{ keys: ['d'], label: 'Remove the event at this frame', group: say, needs: 'review', run: () => {
			const event = eventAt(doing.current.frames?.events ?? [], doing.current.at);
			if (event) doing.current.correct(event.kind, false);
			else explain('There is no event near this frame to remove.');
		} },
		{ keys: ['Ctrl+z'], label: 'Undo the last verdict or change of events, also of the track before', group: say, needs: 'review', run: () => doing.current.undo() },
	];
}
