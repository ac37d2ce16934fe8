// @ts-check
/** How the review screen looks: what is focused, selected, shown. */

import { signal } from '@preact/signals';

import { stored } from '../lib/storage.js';

/** @typedef {{kind: 'point', view: string, marking: string, index: number}} PointSelection */
/** @typedef {{kind: 'ball', view: string}} BallSelection */
/** @typedef {{kind: 'prediction', view: string, prediction: number}} PredictionSelection */
/** @typedef {PointSelection | BallSelection | PredictionSelection} Selection */

const GAINS = [1, 5, 20];

/** Letter of the focused view; letters keep their place from group to group. */
export const focused = signal('A');
/** Letter of the only view shown, or null. */
export const maximised = signal(/** @type {string | null} */ (null));
/** The object that keys move. */
export const selected = signal(/** @type {Selection | null} */ (null));
/** What the person is asked before a verdict can be given; null when nothing. */
export const asking = signal(/** @type {null | 'reason' | 'view' | 'viewNote' | 'note' | 'override' | 'staged' | 'swap'} */ (null));
/** Whether Tab walks through the objects of the focused view. */
export const editing = signal(false);

/** @typedef {{letter: string, view: string, at: {x: number, y: number}}} PointerPlace   image pixels */
/** What the pointer is over; null when that is no view. */
export const pointerPlace = signal(/** @type {PointerPlace | null} */ (null));
/** Whether the magnifying glass is held. */
export const loupe = signal(false);
/** What a click draws; null when nothing. `ask`: the person chooses what; `over`: where the pointer was before. */
export const drawing = signal(
	/** @type {{view: string, what: 'ask' | 'ball' | 'line', marking: string, over?: PointerPlace | null} | null} */ (null),
);

/** Another frame than its own that a view shows, with nothing drawn on it; null: none does. `view` is an id. */
export const otherInstant = signal(/** @type {{view: number, offset: number, label: string, image: string} | null} */ (null));

export const overlaysHidden = signal(false);
export const projections = stored('projections', true);
export const boxes = stored('boxes', true);
export const gain = stored('whisker-gain', 5);
/** Whether whiskers lead to the paint in the picture instead of to what was clicked. */
export const residualLines = stored('paint-whiskers', false);
/** Which 3D ball is drawn and measured: the one that the policy exports, mean of pairs or most likely point, or the other. */
export const estimator = stored('estimator', /** @type {'exported' | 'other'} */ ('exported'));
/** Whether the gates show what they ask of the group, and by how much. */
export const gatesOpen = stored('gates-open', false);
/** Whether every view is as large as the main camera's. */
export const equalViews = stored('equal-views', false);
export const stripCollapsed = stored('strip-collapsed', false);

/** Which opening of the help is shown; 0: none. */
export const helpOpen = signal(0);
let openings = 0;

/** Which part of the help is shown. */
export const helpTab = signal('keys');

/** Show a part of the help over the page, though one that was just left may still be closing. @param {string} tab */
export function openHelpAt(tab) {
	openings += 1;
	helpTab.value = tab;
	helpOpen.value = openings;
}

/** Show the keys of the page. */
export function openHelp() {
	openHelpAt('keys');
}

/** The next whisker gain. */
export function cycleGain() {
	gain.value = GAINS[(GAINS.indexOf(gain.value) + 1) % GAINS.length];
}

/** Whether a finger points: as on a phone. */
export function isTouched() {
	return globalThis.matchMedia?.('(pointer: coarse)').matches ?? false;
}

/** Whether the window is as small as a phone's: there groups are looked at and judged, not drawn in. As in `css/phone.css`. */
export function isSmall() {
	return globalThis.matchMedia?.('(max-width: 640px), (max-height: 480px) and (pointer: coarse)').matches ?? false;
}

/** Look at the other 3D ball. */
export function cycleEstimator() {
	estimator.value = estimator.value === 'other' ? 'exported' : 'other';
}

/** @param {string} letter */
export function focusView(letter) {
	if (letter !== focused.value) otherInstant.value = null;
	focused.value = letter;
	if (maximised.value) maximised.value = letter;
}

/** @typedef {{view: string | null, marking?: string | null, index?: number | null, ball?: boolean}} Place   a view by its key, or a marking, a point of it or the ball there */

/**
 * Lead to the view and the line that a sentence speaks of.
 *
 * @param {import('../api/types.js').GroupDocument} group @param {Place} place
 */
export function pointTo(group, { view: key, marking, index, ball }) {
	const view = group.views.find((one) => one.key === key);
	if (!view) return;
	focusView(view.letter);
	if (ball) selected.value = { kind: 'ball', view: view.key };
	else if (marking && view.lines[marking]) selected.value = { kind: 'point', view: view.key, marking, index: index ?? 0 };
}

/** @param {string} letter */
export function toggleMaximised(letter) {
	focused.value = letter;
	maximised.value = maximised.value ? null : letter;
}

/** Drop what belongs to one group only. */
export function resetForGroup() {
	maximised.value = null;
	selected.value = null;
	editing.value = false;
	asking.value = null;
	drawing.value = null;
	otherInstant.value = null;
}
