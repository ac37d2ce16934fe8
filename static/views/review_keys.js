// @ts-check
/** What the keys of the review screen do. */

import { ballCenter, ballOf } from '../geometry/preview.js';
import { draft, group, submit, withdraw } from '../state/group.js';
import { redo, undo } from '../state/history.js';
import { goNext, goPrevious } from '../state/navigation.js';
import { announce, dismiss, notice } from '../state/notice.js';
import { accept, askReason, cancelAsking, defer } from '../state/verdicts.js';
import { fitAll, fitPanel, isZoomed, zoomTo } from '../state/viewports.js';
import {
	asking, boxes, cycleGain, editing, focused, focusView, gain, maximised, overlaysHidden,
	projections, selected, stripCollapsed, toggleMaximised,
} from '../state/workspace.js';
import { deleteSelected, nudge, nudgeDiameter } from '../tools/nudge.js';

/** @import {Binding} from '../lib/keys.js' */

/** Screen pixels per image pixel when zoomed to the ball. */
const BALL_SCALE = 8;
const DIGITS = ['1', '2', '3', '4', '5', '6'];

/** @param {number} index @returns {string | null} letter of the view in that place */
function letterAt(index) {
	return group.value?.views[index]?.letter ?? null;
}

/** Focus a view; the second time show it alone. @param {number} index */
function focusAt(index) {
	const letter = letterAt(index);
	if (!letter) announce(`There is no view ${index + 1}.`);
	else if (focused.value === letter) toggleMaximised(letter);
	else focusView(letter);
}

/** @param {number} index */
function toggleIncluded(index) {
	const view = group.value?.views[index];
	if (view) submit({ kind: 'include', view: view.key, included: !view.included });
}

/** Leave one thing at a time. */
function escape() {
	if (asking.value) cancelAsking();
	else if (draft.value) withdraw();
	else if (editing.value) editing.value = false;
	else if (selected.value) selected.value = null;
	else if (maximised.value) maximised.value = null;
	else if (notice.value) dismiss();
}

/** Zoom the focused view to its ball; the second time show it whole again. */
function zoomToBall() {
	const view = group.value?.views.find(({ letter }) => letter === focused.value);
	const ball = view && ballOf(view);
	const center = ball && ballCenter(ball);
	const stage = document.querySelector(`.image-panel[data-view="${focused.value}"] .image-panel__stage`);
	if (!center || !stage) {
		announce(`There is no ball in view ${focused.value}.`);
		return;
	}
	const { width, height } = stage.getBoundingClientRect();
	if (isZoomed(focused.value)) fitPanel(focused.value);
	else zoomTo(focused.value, { width, height }, center, BALL_SCALE);
}

/** @param {string} word @param {boolean} on */
function say(word, on) {
	announce(`${word} ${on ? 'shown' : 'hidden'}.`);
}

const isSelected = () => selected.value !== null;

/** @param {string} arrow @param {number} x @param {number} y @returns {Binding} */
function arrowKey(arrow, x, y) {
	return {
		keys: [`Arrow${arrow}`, `Shift+Arrow${arrow}`, `Alt+Arrow${arrow}`], group: 'Edit',
		label: `Move the selected object ${arrow.toLowerCase()}`, shown: 'hidden',
		when: isSelected, run: (event) => nudge(x, y, event),
	};
}

/** @type {Binding[]} */
const VERDICT = [
	{ keys: ['a', 'Ctrl+Enter'], label: 'Accept and next', group: 'Verdict', run: accept },
	{ keys: ['x'], label: 'Reject; then a digit for the reason', group: 'Verdict', run: askReason },
	{ keys: ['s'], label: 'Defer and next', group: 'Verdict', run: defer },
];

/** @type {Binding[]} */
const NAVIGATE = [
	{ keys: ['f'], label: 'Next group', group: 'Navigate', run: () => { goNext(); } },
	{ keys: ['d'], label: 'Previous group', group: 'Navigate', run: () => { goPrevious(); } },
];

/** @type {Binding[]} */
const VIEW = [
	...DIGITS.map((digit, i) => ({
		keys: [digit], label: 'Focus a view; again: show it alone', group: 'View',
		shown: i === 0 ? '1 … 6' : 'hidden', run: () => focusAt(i),
	})),
	...DIGITS.map((digit, i) => ({
		keys: [`Shift+${digit}`], label: 'Use a view or leave it out', group: 'View',
		shown: i === 0 ? 'Shift + 1 … 6' : 'hidden', run: () => toggleIncluded(i),
	})),
	{ keys: ['z'], label: 'Zoom to the ball; again: whole image', group: 'View', run: zoomToBall },
	{ keys: ['0'], label: 'Show images whole', group: 'View', run: fitAll },
	{
		keys: ['h'], label: 'Hide or show everything drawn', group: 'View',
		run: () => { overlaysHidden.value = !overlaysHidden.value; say('Overlays', !overlaysHidden.value); },
	},
	{
		keys: ['p'], label: 'Projected lines', group: 'View',
		run: () => { projections.value = !projections.value; say('Projected lines', projections.value); },
	},
	{
		keys: ['b'], label: 'Ball boxes', group: 'View',
		run: () => { boxes.value = !boxes.value; say('Ball boxes', boxes.value); },
	},
	{
		keys: ['w'], label: 'Residual whiskers × 1, 5, 20', group: 'View',
		run: () => { cycleGain(); announce(`Whiskers times ${gain.value}.`); },
	},
	{
		keys: ['l'], label: 'Fold the strip below', group: 'View',
		run: () => { stripCollapsed.value = !stripCollapsed.value; },
	},
];

/** @type {Binding[]} */
const EDIT = [
	{
		keys: ['Enter'], label: 'Walk through the objects of the view', group: 'Edit',
		when: () => !editing.value,
		run: () => { editing.value = true; },
	},
	{ keys: ['Escape'], label: 'Leave, or give back what is held', group: 'Edit', typing: true, run: escape },
	{
		keys: [], label: 'Move by 1 px; Shift 5 px; Alt 0.1 px', group: 'Edit', shown: '← ↑ → ↓',
		run: () => {},
	},
	arrowKey('Left', -1, 0), arrowKey('Right', 1, 0), arrowKey('Up', 0, -1), arrowKey('Down', 0, 1),
	{ keys: ['['], label: 'Ball smaller by 0.25 px', group: 'Edit', run: () => nudgeDiameter(-1) },
	{ keys: [']'], label: 'Ball larger by 0.25 px', group: 'Edit', run: () => nudgeDiameter(1) },
	{
		keys: ['Delete', 'Backspace'], label: 'Delete the selected object', group: 'Edit',
		when: isSelected, run: deleteSelected,
	},
	{ keys: ['Ctrl+z'], label: 'Undo', group: 'Edit', run: undo },
	{ keys: ['Ctrl+Shift+z', 'Ctrl+y'], label: 'Redo', group: 'Edit', run: redo },
];

export const REVIEW_KEYS = [...VERDICT, ...NAVIGATE, ...VIEW, ...EDIT];
