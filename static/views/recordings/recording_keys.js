// @ts-check
/** Keys of the page of a recording. */

import { explain } from '../../state/notice.js';
import { goTo, run, stand, stepBy, toggleRunning, wanted } from '../../state/playback.js';
import { changedAt, mergedWithNext, SHOT_KINDS, shotAt, splitAt } from '../../state/shots.js';

/** @import {RecordingJson, Shot} from '../../api/recordings.js' */
/** @import {Binding} from '../../lib/keys.js' */

/** @typedef {{change: (items: Shot[] | null, told: string) => void, undo: () => void, turn: (frame: number) => void}} Doing */

/**
 * @param {RecordingJson} one
 * @param {() => Shot[]} shots as they are when a key is pressed
 * @param {{current: Doing}} doing
 * @returns {Binding[]}
 */
export function keysOfRecording(one, shots, doing) {
	const at = () => shotAt(shots(), wanted.value);
	/** @param {number} step */
	const shotBy = (step) => {
		const all = shots();
		const next = all[Math.min(Math.max(at() + step, 0), all.length - 1)];
		if (next) goTo(next.first);
	};
	/** @param {Partial<Shot>} change @param {string} told */
	const set = (change, told) => doing.current.change(changedAt(shots(), at(), change), told);
	/** @param {Shot[] | null} items @param {string} told @param {string} why nothing can be done here */
	const change = (items, told, why) => { if (items) doing.current.change(items, told); else explain(why); };
	const second = Math.round(one.fps ?? 25);
	const [look, edit] = ['Recording', 'Shots'];
	return [
		{ keys: [' '], label: 'Play or stop', group: look, shown: 'Space', run: toggleRunning },
		{ keys: ['l'], label: 'Play forwards; press again to double the speed', group: look, run: () => run(1) },
		{ keys: ['k'], label: 'Stop', group: look, run: stand },
		{ keys: ['j'], label: 'Play backwards; press again to double the speed', group: look, run: () => run(-1) },
		{ keys: ['ArrowRight'], label: 'Next frame', group: look, repeats: true, run: () => { stepBy(1); } },
		{ keys: ['ArrowLeft'], label: 'Previous frame', group: look, repeats: true, run: () => { stepBy(-1); } },
		{ keys: ['Shift+ArrowRight'], label: 'One second forward', group: look, repeats: true, run: () => { stepBy(second); } },
		{ keys: ['Shift+ArrowLeft'], label: 'One second back', group: look, repeats: true, run: () => { stepBy(-second); } },
		{ keys: ['ArrowDown'], label: 'Next shot', group: look, repeats: true, run: () => shotBy(1) },
		{ keys: ['ArrowUp'], label: 'Previous shot', group: look, repeats: true, run: () => shotBy(-1) },
		{ keys: ['s'], label: 'Split the shot at this frame', group: edit, needs: 'annotate', run: () => change(splitAt(shots(), wanted.value), 'Split.', 'The shot begins with this frame. Go to a later frame of the shot to split it.') },
		{ keys: ['m'], label: 'Merge the shot with the next', group: edit, needs: 'annotate', run: () => change(mergedWithNext(shots(), at()), 'Merged with the next shot.', 'This is the last shot: there is no next one to merge it with.') },
		...SHOT_KINDS.map(({ kind, label }, index) => /** @type {Binding} */ ({
			keys: [String(index + 1)], label: `Set the kind of the shot: ${label}`, group: edit, needs: 'annotate', run: () => set({ kind }, `The kind of this shot is now ${label}.`),
		})),
		{ keys: ['a'], label: 'Keep the shot', group: edit, needs: 'annotate', run: () => set({ kept: true }, 'The shot is kept.') },
		{ keys: ['x'], label: 'Drop the shot', group: edit, needs: 'annotate', run: () => set({ kept: false }, 'The shot is dropped.') },
		{ keys: ['Ctrl+z'], label: 'Undo the last change of the shots', group: edit, needs: 'annotate', run: () => doing.current.undo() },
		{ keys: ['i'], label: 'Choose this frame as an instant; press again to remove it', group: edit, run: () => doing.current.turn(wanted.value) },
	];
}
