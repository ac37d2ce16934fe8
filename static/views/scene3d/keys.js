// @ts-check
/** Keys of the 3D view while it is shown. */

import { group } from '../../state/group.js';
import { explain } from '../../state/notice.js';
import { goToPreset, lookThrough, sceneShown, standpoint } from '../../state/scene3d.js';
import { leaveCamera } from './gestures.js';
import { approached, turned } from './standpoints.js';

/** @import {Binding} from '../../lib/keys.js' */
/** @import {SceneStage} from './stage.js' */
/** @import {Orbit} from './standpoints.js' */

const STEP = Math.PI / 36;

/**
 * @typedef {object} Habits where the scene stands
 * @property {() => boolean} turns whether arrows turn it now
 * @property {() => void} leave
 * @property {boolean} digits whether digits look through cameras
 */

/** @type {Habits} */
const REVIEW = { turns: notScrolling, leave: () => { sceneShown.value = false; }, digits: true };

/** @param {() => SceneStage | null} stage @param {Habits} [habits] @returns {Binding[]} */
export function sceneKeys(stage, { turns, leave, digits } = REVIEW) {
	/** @param {(orbit: Orbit) => Orbit} change */
	const turn = (change) => () => {
		leaveCamera();
		const present = stage();
		if (present?.orbit) present.set(change(present.orbit));
	};
	/** @param {string} arrow @param {number} azimuth @param {number} elevation @returns {Binding} */
	const arrow = (arrow, azimuth, elevation) => ({
		keys: [`Arrow${arrow}`], label: 'Turn the scene', group: '3D', shown: arrow === 'Left' ? '← ↑ → ↓' : 'hidden',
		when: turns, repeats: true, run: turn((orbit) => turned(orbit, azimuth, elevation)),
	});
	return [
		arrow('Left', -STEP, 0), arrow('Right', STEP, 0), arrow('Up', 0, STEP), arrow('Down', 0, -STEP),
		{ keys: ['+', '='], label: 'Closer', group: '3D', shown: '+', repeats: true, run: turn((orbit) => approached(orbit, 0.85)) },
		{ keys: ['-'], label: 'Farther', group: '3D', repeats: true, run: turn((orbit) => approached(orbit, 1 / 0.85)) },
		{ keys: ['0'], label: 'Whole scene', group: '3D', run: () => goToPreset('whole') },
		{ keys: ['7'], label: 'From above', group: '3D', run: () => goToPreset('top') },
		{ keys: ['8'], label: 'From the side', group: '3D', run: () => goToPreset('side') },
		{ keys: ['9'], label: 'From the goal', group: '3D', run: () => goToPreset('goal') },
		{ keys: ['z'], label: 'At the ball', group: '3D', run: () => goToPreset('ball') },
		...(digits ? ['1', '2', '3', '4', '5', '6'] : []).map((digit, i) => ({
			keys: [digit], label: 'Look through a camera; press again to step back', group: '3D',
			shown: i === 0 ? '1 … 6' : 'hidden', run: () => throughCamera(i),
		})),
		{ keys: ['Escape'], label: 'Step back out of a camera, then to the images', group: '3D', run: () => stepBack(leave) },
	];
}

/** Arrows scroll where something that scrolls has the focus. */
function notScrolling() {
	return !document.activeElement?.closest('.rail__scroll, .scene3d__table');
}

/** @param {number} index */
function throughCamera(index) {
	const view = group.value?.views[index];
	if (view) lookThrough(view.letter);
	else explain(`There is no view ${index + 1}.`);
}

/** @param {() => void} leave */
function stepBack(leave) {
	if (standpoint.value.kind === 'camera') goToPreset('whole');
	else leave();
}
