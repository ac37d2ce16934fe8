// @ts-check
/** Keys of the calibration editor. */

import { navigate } from '../../lib/router.js';
import {
	choice, discardStaged, held, lines, mode, redo, undo, view,
} from '../../state/calibration.js';
import { group } from '../../state/group.js';
import { reviewAddress } from '../../state/navigation.js';
import { announce, dismiss, explain, notice } from '../../state/notice.js';
import { proposeFromPaint, snapToPaint, togglePaint } from '../../state/paint.js';
import { fitPanel, isZoomed, zoomTo } from '../../state/viewports.js';
import { cycleGain, gain, overlaysHidden, projections } from '../../state/workspace.js';
import {
	deleteChosen, deleteMarking, insertPoint, nudgePoint, save, stepMarking, stepPoint, swapAllSides, toggleDrawing,
	toggleRelabelling,
} from './actions.js';
import { editorAddress } from '../../state/editor_address.js';
import { panelKey } from './panel_key.js';

/** @import {Binding} from '../../lib/keys.js' */

const CLOSE = 6;

/** Leave one thing at a time, the editor last. */
function escape() {
	const at = group.value;
	if (held.value) held.value = null;
	else if (mode.value !== 'select') mode.value = 'select';
	else if (choice.value) choice.value = null;
	else if (notice.value) dismiss();
	else if (at) navigate(reviewAddress(at.id));
}

/** Zoom to the point in hand; the second time show the image whole. */
function zoomToPoint() {
	const at = view.value;
	const chosen = choice.value;
	const point = chosen && lines.value[chosen.marking]?.[chosen.index ?? 0];
	const stage = document.querySelector('.editor__panel .image-panel__stage');
	if (!at || !stage) return;
	if (isZoomed(panelKey(at.letter)) || !point) fitPanel(panelKey(at.letter));
	else {
		const { width, height } = stage.getBoundingClientRect();
		zoomTo(panelKey(at.letter), { width, height }, point, CLOSE);
	}
}

/** @param {number} index */
function goToView(index) {
	const [at, other] = [group.value, group.value?.views[index]];
	if (at && other) navigate(editorAddress(at.id, other.key), { replace: true });
	else explain(`There is no view ${index + 1}.`);
}

/** Move the points of the marking in hand. */
function snapMarking() {
	if (choice.value) snapToPaint(choice.value.marking);
	else explain('Choose a marking first.');
}

const hasPoint = () => choice.value !== null && choice.value.index !== null;
/** Arrows scroll where something that scrolls has the focus. */
const notScrolling = () => hasPoint() && !document.activeElement?.closest('.editor__scroll');

/** @param {string} name @param {number} x @param {number} y @returns {Binding} */
function arrow(name, x, y) {
	return {
		keys: [`Arrow${name}`, `Shift+Arrow${name}`, `Alt+Arrow${name}`], group: 'Edit', shown: 'hidden',
		label: `Move the point ${name.toLowerCase()}`, when: notScrolling, repeats: true,
		run: ({ shiftKey, altKey }) => {
			const step = altKey ? 0.1 : shiftKey ? 5 : 1;
			nudgePoint(x * step, y * step);
		},
	};
}

/** @type {Binding[]} */
export const EDITOR_KEYS = [
	{ keys: ['n'], label: 'Draw the marking: click to set its points', group: 'Edit', run: toggleDrawing },
	{ keys: ['i'], label: 'Insert a point after the selected one', group: 'Edit', run: insertPoint },
	{ keys: ['r'], label: 'Relabel the marking', group: 'Edit', run: toggleRelabelling },
	{ keys: ['m'], label: 'Swap sides', group: 'Edit', run: swapAllSides },
	{ keys: ['k'], label: 'Move all points onto the paint', group: 'Edit', run: () => { snapToPaint(); } },
	{ keys: ['Shift+k'], label: 'Move the marking’s points onto the paint', group: 'Edit', run: snapMarking },
	{ keys: [], label: 'Drag a point along the paint', group: 'Edit', shown: '⇧ drag', run: () => {} },
	{ keys: ['Shift+p'], label: 'Propose lines from the paint, where there is no camera', group: 'Edit', run: () => { proposeFromPaint(); } },
	{ keys: ['Delete', 'Backspace'], label: 'Delete the point, or the marking', group: 'Edit', run: deleteChosen },
	{ keys: ['Shift+Delete', 'Shift+Backspace'], label: 'Delete the marking', group: 'Edit', run: deleteMarking },
	{ keys: [], label: 'Move by 1 px; Shift 5 px; Alt 0.1 px', group: 'Edit', shown: '← ↑ → ↓', run: () => {} },
	arrow('Left', -1, 0), arrow('Right', 1, 0), arrow('Up', 0, -1), arrow('Down', 0, 1),
	{ keys: ['.'], label: 'Next point', group: 'Choose', repeats: true, run: () => stepPoint(1) },
	{ keys: [','], label: 'Previous point', group: 'Choose', repeats: true, run: () => stepPoint(-1) },
	{ keys: [']'], label: 'Next marking', group: 'Choose', repeats: true, run: () => stepMarking(1) },
	{ keys: ['['], label: 'Previous marking', group: 'Choose', repeats: true, run: () => stepMarking(-1) },
	...['1', '2', '3', '4', '5', '6'].map((digit, i) => ({
		keys: [digit], label: 'Another view', group: 'Choose', shown: i === 0 ? '1 … 6' : 'hidden', run: () => goToView(i),
	})),
	{ keys: ['z'], label: 'Zoom to the point; press again to show the whole image', group: 'View', run: zoomToPoint },
	{ keys: ['0'], label: 'Whole image', group: 'View', run: () => { if (view.value) fitPanel(panelKey(view.value.letter)); } },
	{ keys: ['h'], label: 'Hide or show all overlays', group: 'View', run: () => { overlaysHidden.value = !overlaysHidden.value; } },
	{ keys: ['p'], label: 'Projected lines', group: 'View', run: () => { projections.value = !projections.value; } },
	{ keys: ['e'], label: 'Show the paint found in the picture', group: 'View', run: togglePaint },
	{ keys: ['w'], label: 'Error lines × 1, 5, 20', group: 'View', run: () => { cycleGain(); announce(`Error lines are drawn ${gain.value} times as long.`); } },
	{ keys: ['Ctrl+s', 'Ctrl+Enter'], label: 'Save everything staged as one edit', group: 'Save', needs: 'annotate', typing: true, run: save },
	{ keys: ['Ctrl+z'], label: 'Undo; staged changes first', group: 'Save', run: undo },
	{ keys: ['Ctrl+Shift+z', 'Ctrl+y'], label: 'Redo', group: 'Save', run: redo },
	{ keys: ['Ctrl+Delete', 'Ctrl+Backspace'], label: 'Discard everything staged', group: 'Save', run: discardStaged },
	{ keys: ['Escape'], label: 'Cancel the current step; press again to return to the review', group: 'Save', typing: true, run: escape },
];
