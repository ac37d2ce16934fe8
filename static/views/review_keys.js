// @ts-check
/** What the keys of the review screen do. */

import { ballName } from '../geometry/estimator.js';
import { ballCenter, ballOf } from '../geometry/preview.js';
import { capital } from '../lib/format.js';
import { toggleOccluded, toggleOutOfView } from '../state/ball_edits.js';
import { dismissShown } from '../state/dismissals.js';
import { drawHere, endDrawing, placeExpected, startDrawing } from '../state/drawing.js';
import { moveCross } from '../state/drawing_cross.js';
import { swapSides } from '../state/edits.js';
import { draft, group, groupDocument, solution, submit, withdraw } from '../state/group.js';
import { askReturn, askTakeOver, canReturn, canTakeOver, submitAndNext } from '../state/return_group.js';
import { redo, undo } from '../state/undo.js';
import { backToInstant, stepInstant } from '../state/instants.js';
import { canSubmit } from '../state/leases.js';
import { isHeld, suggestion, suggestions, nextSuggestion } from '../state/suggestions.js';
import { goBy, goFlagged, goNext, goPrevious, historyAddress } from '../state/navigation.js';
import { announce, dismiss, explain, notice } from '../state/notice.js';
import { revertSelected } from '../state/revert.js';
import { swapWarning, swappedViews } from '../state/sides.js';
import { annotateOwn, guidelinesShown, markGold } from '../state/independent_annotations.js';
import { accept, askReason, askViewReason, cancelAsking, defer } from '../state/verdicts.js';
import { filled, fitAll, fitPanel, isZoomed, toggleFilled, viewportOf, zoomTo } from '../state/viewports.js';
import {
	asking, boxes, cycleEstimator, cycleGain, drawing, editing, equalViews, estimator, focused, focusView, gain,
	gatesOpen, loupe, maximised, otherInstant, overlaysHidden, residualLines, projections,
	selected, stripCollapsed, toggleMaximised,
} from '../state/workspace.js';
import { navigate } from '../lib/router.js';
import { compose } from '../state/threads.js';
import { deleteSelected, nudge, nudgeDiameter } from '../tools/nudge.js';
import { EDITOR_DOOR } from './calibration/open.js';
import { applySuggestion } from './suggestion_actions.js';
import { acceptFollowedHere, followOrAccept, isFollowing, leaveFollow } from './follow_parts.js';
import { acceptAll, acceptInHand, hasPredictions } from './prediction_parts.js';
import { acceptProposed } from './proposal_parts.js';
import { SCENE_KEYS } from './scene3d/scene3d.js';

/** @import {Binding} from '../lib/keys.js' */

/** Screen pixels per image pixel when zoomed to the ball. */
const BALL_SCALE = 8;
/** Groups that V and C pass. */
const FAR = 10;
const DIGITS = ['1', '2', '3', '4', '5', '6'];

/** @param {number} index @returns {string | null} letter of the view in that place */
function letterAt(index) {
	return group.value?.views[index]?.letter ?? null;
}

/** Focus a view; the second time show it alone. @param {number} index */
function focusAt(index) {
	const letter = letterAt(index);
	if (!letter) explain(`There is no view ${index + 1}.`);
	else if (focused.value === letter) toggleMaximised(letter);
	else focusView(letter);
}

/** @param {number} index */
function toggleIncluded(index) {
	const view = group.value?.views[index];
	if (view) submit({ kind: 'include', view: view.key, included: !view.included });
	else explain(`There is no view ${index + 1}.`);
}

/** Leave one thing at a time. */
function escape() {
	if (asking.value) cancelAsking();
	else if (drawing.value) endDrawing();
	else if (draft.value) withdraw();
	else if (otherInstant.value) backToInstant();
	else if (editing.value) editing.value = false;
	else if (selected.value) selected.value = null;
	else if (isFollowing()) leaveFollow();
	else if (maximised.value) maximised.value = null;
	else if (notice.value) dismiss();
}

/** Zoom the focused view to its ball; the second time show it whole again. */
function zoomToBall() {
	const view = group.value?.views.find(({ letter }) => letter === focused.value);
	const ball = view && ballOf(view);
	const place = solution.value?.views.find((one) => one.view === view?.key)?.expected?.place;
	// Where nobody has drawn it: to where the other views see it.
	const center = (ball && ballCenter(ball)) ?? (place && { x: place[0], y: place[1] });
	const stage = document.querySelector(`.image-panel[data-view="${focused.value}"] .image-panel__stage`);
	if (!center || !stage) {
		explain(`View ${focused.value} has no ball, and the other views do not locate it.`);
		return;
	}
	const { width, height } = stage.getBoundingClientRect();
	const zoomed = isZoomed(focused.value);
	if (zoomed) fitPanel(focused.value);
	else zoomTo(focused.value, { width, height }, center, BALL_SCALE);
	announce(`View ${focused.value} ${zoomed ? 'is shown whole' : 'is zoomed to the ball'}.`);
}

/** Crop the images to their panels, or show them whole. */
function fillPanels() {
	toggleFilled();
	announce(filled.value ? 'Images fill their panels. Drag to move them.' : 'Images are shown whole.');
}

/** @param {string} word @param {boolean} on */
function say(word, on) {
	announce(`${word} ${on ? 'shown' : 'hidden'}.`);
}

const isSelected = () => selected.value !== null;
const isDrawing = () => drawing.value !== null && drawing.value.what !== 'ask';

/** The view that keys speak about: that of the selected object, else the focused one. */
function viewInHand() {
	const object = selected.value;
	return group.value?.views.find((view) => (object ? view.key === object.view : view.letter === focused.value));
}

/** Change the ball of the view in hand. @param {typeof toggleOccluded} change @param {string} otherwise */
function changeBall(change, otherwise) {
	const view = viewInHand();
	const edit = view && change(view);
	if (!view) return;
	if (edit) submit(edit);
	else explain(`${otherwise} ${view.letter}.`);
}

/** Left becomes right, for labels that somebody took from the other end: in the view that a finding names, else the focused one. */
function swap() {
	const shown = group.value;
	const view = shown?.views.find(({ letter }) => letter === focused.value);
	if (!shown || !view) return;
	const named = swappedViews(solution.value);
	const elsewhere = named.length > 0 && !named.includes(view.key);
	if (Object.keys(view.lines).length === 0) explain(`View ${view.letter} has no lines.`);
	else if (elsewhere || swapWarning(shown, solution.value, view)) asking.value = 'swap';
	else submit(swapSides(view));
}

/** Accept the prediction in hand, else put the ball where the other views see it. */
function takeBall() {
	const view = viewInHand();
	if (selected.value?.kind !== 'prediction' && acceptFollowedHere(view)) return;
	const predicted = selected.value?.kind === 'prediction' || hasPredictions();
	if (predicted || !view || view.balls.length > 0) acceptInHand();
	else if (!placeExpected(view)) explain(`The other views do not tell where the ball is in view ${view.letter}. Press N to draw it.`);
}

/** Make the group of the view in hand, too. */
function useView() {
	const view = group.value?.views.find(({ letter }) => letter === focused.value);
	if (!view) return;
	if (view.included) explain(`View ${view.letter} is already used for the 3D ball.`);
	else submit({ kind: 'include', view: view.key, included: true });
}

/** Which 3D ball is looked at. */
function otherEstimator() {
	cycleEstimator();
	announce(`${capital(ballName(solution.value, estimator.value))}.`);
}

/** Who changed what in the group. */
function openHistory() {
	const at = groupDocument.value;
	if (at) navigate(historyAddress(at.id));
}

/** Show the gates with all that they say. */
function showGates() {
	gatesOpen.value = !gatesOpen.value;
	document.querySelector('.gates')?.scrollIntoView({ block: 'nearest' });
	say('Details of the gates', gatesOpen.value);
}

/** Every view, none of them zoomed. */
function showAll() {
	maximised.value = null;
	fitAll();
	announce('All views are shown whole.');
}

function flipOverlays() {
	overlaysHidden.value = !overlaysHidden.value;
	say('Overlays', !overlaysHidden.value);
}

/** Move the cross where Enter draws. @param {number} x @param {number} y @param {KeyboardEvent} event */
function aim(x, y, event) {
	const view = group.value?.views.find(({ key }) => key === drawing.value?.view);
	const stage = view && document.querySelector(`.image-panel[data-view="${view.letter}"] .image-panel__stage`);
	if (!stage) return;
	const { width, height } = stage.getBoundingClientRect();
	moveCross(view, viewportOf(view.letter, view, { width, height }).scale, x, y, event);
}

/** @param {string} arrow @param {number} x @param {number} y @returns {Binding} */
function arrowKey(arrow, x, y) {
	return {
		keys: [`Arrow${arrow}`, `Shift+Arrow${arrow}`, `Alt+Arrow${arrow}`], group: 'Edit', needs: 'annotate',
		label: `Move the selected object ${arrow.toLowerCase()}`, shown: 'hidden',
		when: () => isDrawing() || isSelected(), repeats: true, run: (event) => (isDrawing() ? aim(x, y, event) : nudge(x, y, event)),
	};
}

/** @type {Binding[]} */
const VERDICT = [
	{ keys: ['a', 'Ctrl+Enter'], label: 'Accept and next', group: 'Verdict', needs: 'review', run: accept },
	{ keys: ['x'], label: 'Reject; then a digit for the reason', group: 'Verdict', needs: 'review', run: askReason },
	{ keys: ['s'], label: 'Defer and next', group: 'Verdict', needs: 'review', run: defer },
	{ keys: ['Shift+a'], label: 'Use the focused view', group: 'Verdict', needs: 'annotate', run: useView },
	{ keys: ['Shift+x'], label: 'Leave the focused view out; then a digit for the reason', group: 'Verdict', needs: 'annotate', run: askViewReason },
	{ keys: ['Shift+s'], label: 'Dismiss the finding on the card (checked, it is fine)', group: 'Verdict', needs: 'review', run: dismissShown },
	{ keys: ['Shift+c', 'Shift+n'], label: 'Comment at the pointer, or on the group', group: 'Verdict', needs: 'annotate', run: compose },
];

/** @type {Binding[]} */
const NAVIGATE = [
	{ keys: ['f'], label: 'Next group', group: 'Navigate', repeats: true, run: () => { goNext(); } },
	{ keys: ['d'], label: 'Previous group', group: 'Navigate', repeats: true, run: () => { goPrevious(); } },
	{ keys: ['Shift+f'], label: 'Submit the group and go to the next one of the batch', group: 'Navigate', needs: 'annotate', when: () => canSubmit.value, run: () => { submitAndNext(); } },
	{ keys: ['Shift+u'], label: 'Return the group to its annotator, with a reason', group: 'Verdict', needs: 'review', when: () => canReturn.value, run: askReturn },
	{ keys: ['Shift+r'], label: 'Apply an independent annotation to its group', group: 'Verdict', needs: 'lead', when: () => canTakeOver.value, run: askTakeOver },
	{ keys: ['v'], label: 'Ten groups forward', group: 'Navigate', repeats: true, run: () => { goBy(1, FAR); } },
	{ keys: ['c'], label: 'Ten groups back', group: 'Navigate', repeats: true, run: () => { goBy(-1, FAR); } },
	{ keys: ['r'], label: 'Next group with a finding', group: 'Navigate', repeats: true, run: () => { goFlagged(1); } },
	{ keys: ['e'], label: 'Previous group with a finding', group: 'Navigate', repeats: true, run: () => { goFlagged(-1); } },
];

/** @type {Binding[]} */
const VIEW = [
	...DIGITS.map((digit, i) => ({
		keys: [digit], label: 'Focus a view; press again to show it alone', group: 'View',
		shown: i === 0 ? '1 … 6' : 'hidden', run: () => focusAt(i),
	})),
	...DIGITS.map((digit, i) => ({
		keys: [`Shift+${digit}`], label: 'Use a view or leave it out', group: 'View', needs: /** @type {const} */ ('annotate'),
		shown: i === 0 ? 'Shift + 1 … 6' : 'hidden', run: () => toggleIncluded(i),
	})),
	{
		keys: ['z'], label: 'Zoom to the ball; press again to show the whole image; hold for the magnifying glass', group: 'View',
		run: zoomToBall,
		hold: { start: () => { loupe.value = true; }, end: () => { loupe.value = false; } },
	},
	{ keys: ['0'], label: 'Leave the zoom, and show all views', group: 'View', run: showAll },
	{ keys: ['Shift+z'], label: 'Crop the images to fill their panels, or show them whole', group: 'View', run: fillPanels },
	{
		keys: ['h'], label: 'Hide or show all overlays; hold: hide them briefly', group: 'View',
		run: flipOverlays, hold: { start: flipOverlays, end: flipOverlays },
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
		keys: ['w'], label: 'Error lines × 1, 5, 20', group: 'View',
		run: () => { cycleGain(); announce(`Error lines are drawn ${gain.value} times as long.`); },
	},
	{
		keys: ['Shift+w'], label: 'Error lines to the paint in the pictures, or to the annotated points', group: 'View',
		run: () => {
			residualLines.value = !residualLines.value;
			announce(residualLines.value ? 'Error lines lead to the paint.' : 'Error lines lead to the annotated points.');
		},
	},
	{ keys: ['Shift+t'], label: 'History of the group: who changed what, with pictures', group: 'View', run: openHistory },
	{ keys: [','], label: 'The focused view one frame before, where the dataset has it', group: 'View', repeats: true, run: () => { stepInstant(-1); } },
	{ keys: ['.'], label: 'The focused view one frame after', group: 'View', repeats: true, run: () => { stepInstant(1); } },
	{ keys: ['t'], label: '3D point: pair average, or most likely point', group: 'View', run: otherEstimator },
	{ keys: ['g'], label: 'Gates: thresholds and margins', group: 'View', run: showGates },
	{
		keys: ['Shift+l'], label: 'Main camera large, or all views equal', group: 'View',
		run: () => { equalViews.value = !equalViews.value; announce(equalViews.value ? 'All views are equally large.' : 'The main camera is large.'); },
	},
	{
		keys: ['l'], label: 'Collapse the strip with ball, lines and pitch', group: 'View',
		run: () => { stripCollapsed.value = !stripCollapsed.value; announce(`Strip with ball, lines and pitch ${stripCollapsed.value ? 'collapsed' : 'shown'}.`); },
	},
];

/** @type {Binding[]} */
const EDIT = [
	{ keys: ['n'], label: 'Draw a ball, a marking, or one more point', group: 'Edit', needs: 'annotate', run: () => startDrawing() },
	{
		keys: ['Enter'], label: 'Add a point at the pointer', group: 'Edit', needs: 'annotate', shown: 'hidden',
		when: isDrawing, run: drawHere,
	},
	{
		keys: [], label: 'Add a point on the line, at the click', group: 'Edit', shown: 'Alt click', run: () => {},
	},
	{
		keys: ['Enter'], label: 'Apply the fix that the card on the right offers', group: 'Edit', needs: 'annotate',
		when: () => !editing.value && (suggestion.value !== null || isHeld.value), run: applySuggestion,
	},
	{
		keys: ['Shift+Enter'], label: 'Show another fix', group: 'Edit',
		when: () => suggestion.value !== null && suggestions.value.length > 1, run: () => nextSuggestion(1),
	},
	{
		// Where the card offers nothing, Enter leads in.
		keys: ['i', 'Enter'], label: 'Step through the objects of the view', group: 'Edit',
		when: () => !editing.value,
		run: () => { editing.value = true; },
	},
	{ keys: ['Escape'], label: 'Cancel, deselect, or close', group: 'Edit', typing: true, run: escape },
	{
		keys: [], label: 'Move by 1 px; Shift 5 px; Alt 0.1 px', group: 'Edit', shown: '← ↑ → ↓',
		run: () => {},
	},
	arrowKey('Left', -1, 0), arrowKey('Right', 1, 0), arrowKey('Up', 0, -1), arrowKey('Down', 0, 1),
	{ keys: ['['], label: 'Ball smaller by 0.25 px', group: 'Edit', needs: 'annotate', repeats: true, run: () => nudgeDiameter(-1) },
	{ keys: [']'], label: 'Ball larger by 0.25 px', group: 'Edit', needs: 'annotate', repeats: true, run: () => nudgeDiameter(1) },
	{
		keys: ['Delete', 'Backspace'], label: 'Delete the selected object', group: 'Edit', needs: 'annotate',
		run: deleteSelected,
	},
	{
		keys: ['q'], label: 'Ball occluded, or not', group: 'Edit', needs: 'annotate',
		run: () => changeBall(toggleOccluded, 'There is no ball in view'),
	},
	{
		keys: ['o'], label: 'Ball out of view, or not', group: 'Edit', needs: 'annotate',
		run: () => changeBall(toggleOutOfView, ''),
	},
	{ keys: ['y'], label: 'Accept the predicted ball, or place it where the other views see it', group: 'Edit', needs: 'annotate', run: takeBall },
	{ keys: ['Shift+q'], label: 'Follow the ball of the view through the groups before and after; press again to accept the result', group: 'Edit', needs: 'annotate', run: () => { followOrAccept(viewInHand()); } },
	{ keys: ['Shift+y'], label: 'Accept predictions in every view without a ball', group: 'Edit', needs: 'annotate', run: acceptAll },
	{ keys: ['Shift+p'], label: 'Accept the lines that are proposed for the view', group: 'Edit', needs: 'annotate', run: acceptProposed },
	{ keys: ['u'], label: 'Reset the selected line or ball to the imported one', group: 'Edit', needs: 'annotate', run: () => { revertSelected(); } },
	{ keys: ['m'], label: 'Swap left and right (first in the view named by a finding)', group: 'Edit', needs: 'annotate', run: swap },
	{ keys: ['Shift+g'], label: 'Guidelines of the dataset', group: 'View', run: () => { guidelinesShown.value = !guidelinesShown.value; } },
	{ keys: ['Shift+o'], label: 'Start an independent annotation on a copy of the group', group: 'Edit', needs: 'annotate', run: annotateOwn },
	{ keys: ['Shift+k'], label: 'Mark as gold group', group: 'Edit', needs: 'lead', run: markGold },
	{ keys: ['Ctrl+z'], label: 'Undo', group: 'Edit', run: undo },
	{ keys: ['Ctrl+Shift+z', 'Ctrl+y'], label: 'Redo', group: 'Edit', run: redo },
];

export const REVIEW_KEYS = [...VERDICT, ...NAVIGATE, ...VIEW, ...SCENE_KEYS, ...EDITOR_DOOR, ...EDIT];
