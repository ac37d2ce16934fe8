// @ts-check
/** How the review screen looks: what is focused, selected, shown. */

import { signal } from '@preact/signals';

import { stored } from '../lib/storage.js';

/** @typedef {{kind: 'point', view: string, marking: string, index: number}} PointSelection */
/** @typedef {{kind: 'ball', view: string}} BallSelection */
/** @typedef {PointSelection | BallSelection} Selection */

const GAINS = [1, 5, 20];

/** Letter of the focused view; letters keep their place from group to group. */
export const focused = signal('A');
/** Letter of the only view shown, or null. */
export const maximised = signal(/** @type {string | null} */ (null));
/** The object that keys move. */
export const selected = signal(/** @type {Selection | null} */ (null));
/** What the person is asked before a verdict can be given; null when nothing. */
export const asking = signal(/** @type {null | 'reason' | 'note' | 'override'} */ (null));
/** Whether Tab walks through the objects of the focused view. */
export const editing = signal(false);

export const overlaysHidden = signal(false);
export const projections = stored('projections', true);
export const boxes = stored('boxes', true);
export const gain = stored('whisker-gain', 5);
export const stripCollapsed = stored('strip-collapsed', false);

/** Whether the page of keys is shown. */
export const helpOpen = signal(false);

/** The next whisker gain. */
export function cycleGain() {
	gain.value = GAINS[(GAINS.indexOf(gain.value) + 1) % GAINS.length];
}

/** @param {string} letter */
export function focusView(letter) {
	focused.value = letter;
	if (maximised.value) maximised.value = letter;
}

/** @param {string} letter */
export function toggleMaximised(letter) {
	focused.value = letter;
	maximised.value = maximised.value ? null : letter;
}

/** Drop what belongs to one group only. */
export function resetForGroup() {
	selected.value = null;
	editing.value = false;
	asking.value = null;
}
