// @ts-check
/** Keys of the timeline; they work where the cameras do not move. */

import { goToWorst, isStatic, stripTab, togglePlaying } from '../../state/timeline.js';

/** @import {Binding} from '../../lib/keys.js' */

/** The other side of the strip below the views. */
function switchTab() {
	stripTab.value = stripTab.value === 'timeline' ? 'ball' : 'timeline';
}

const hasTimeline = () => isStatic.value && stripTab.value === 'timeline';

/** @type {Binding[]} */
export const TIMELINE_KEYS = [
	{ keys: ['Shift+j'], label: 'Close-ups of ball and lines, or the timeline', group: 'View', when: () => isStatic.value, run: switchTab },
	{ keys: [' '], label: 'Play the frames or stop', group: 'Navigate', shown: 'Space', when: hasTimeline, run: togglePlaying },
	{ keys: ['j'], label: 'Worst frame; press again for the next worst', group: 'Navigate', when: hasTimeline, run: goToWorst },
];
