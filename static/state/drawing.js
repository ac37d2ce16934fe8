// @ts-check
/** Drawing what is missing: a ball, a marking, a point more. Every click is saved at once. */

import { previewBall } from '../geometry/preview.js';
import { toImage } from '../geometry/viewport.js';
import { addPoint, markingAt } from './line_edits.js';
import { expectedDiameter, newBall, placeBall } from './ball_edits.js';
import { chosenPlace, dropCross, setCross } from './drawing_cross.js';
import { applyEdit } from './edits.js';
import { group, solution, submit } from './group.js';
import { announce, complain, explain } from './notice.js';
import { drawing, focused, focusView, isSmall, isTouched, pointerPlace, selected } from './workspace.js';

/** @import {GroupDocument, PointJson, ViewJson} from '../api/types.js' */
/** @import {ScreenPoint, Viewport} from '../geometry/viewport.js' */

/** CSS pixels within which a line is meant. */
const REACH = 9;
const BY_KEYS = 'By keyboard: move the cross there with the arrow keys, then press Enter.';

/** @returns {ViewJson | undefined} the view under the pointer, else the focused one */
function targetView() {
	const letter = pointerPlace.value?.letter ?? focused.value;
	return group.value?.views.find((view) => view.letter === letter);
}

/** Say that drawing needs room, where there is too little. */
function hasNoRoom() {
	const small = isSmall();
	if (small) complain(`Drawing needs ${isTouched() ? 'a wider screen: open this group on a computer' : 'a larger window, or a smaller zoom'}.`);
	return small;
}

/** Begin to draw; the marking of the selected point is gone on with, else one chooses. @param {string} [letter] */
export function startDrawing(letter) {
	const view = letter ? group.value?.views.find((one) => one.letter === letter) : targetView();
	if (!view || hasNoRoom()) return;
	focused.value = view.letter;
	const object = selected.value;
	const goesOn = object?.kind === 'point' && object.view === view.key;
	if (goesOn) startMarking(view, object.marking);
	// What asks may open over the pointer, and hide where it was.
	else drawing.value = { view: view.key, what: 'ask', marking: '', over: letter ? null : pointerPlace.value };
}

/** Draw the ball of a view. @param {ViewJson} view @param {PointJson} [at] where it may be, if more is known than the solution says */
export function startBall(view, at) {
	if (hasNoRoom()) return;
	focused.value = view.letter;
	drawing.value = { view: view.key, what: 'ball', marking: '' };
	setCross(view, at ?? likelyPlace(view));
	announce(`Click where the ball is. ${BY_KEYS}`);
}

/** Put the ball where the other views see it. @param {ViewJson} view @returns {boolean} whether that is known */
export function placeExpected(view) {
	const expected = solution.value?.views.find((one) => one.view === view.key)?.expected;
	if (!expected) return false;
	submit(placeBall(view, expected));
	focusView(view.letter);
	selected.value = { kind: 'ball', view: view.key };
	announce(`Ball of ${view.letter} placed where the other views see it. It does not count as a measurement until you move it.`);
	return true;
}

/** Draw a marking of a view. @param {ViewJson} view @param {string} marking */
export function startMarking(view, marking) {
	if (hasNoRoom()) return;
	focused.value = view.letter;
	selected.value = null;
	drawing.value = { view: view.key, what: 'line', marking };
	setCross(view, likelyPlace(view));
	announce(`Drawing ${marking}. Click to add a point; Escape ends. ${BY_KEYS}`);
}

/** Stop drawing. */
export function endDrawing() {
	drawing.value = null;
	dropCross();
}

/** What is drawn was chosen: the ball where the pointer is, a marking click by click. @param {string | null} marking null: the ball */
export function chooseDrawing(marking) {
	const present = drawing.value;
	const view = group.value?.views.find(({ key }) => key === present?.view);
	if (!view) return;
	if (marking === null) {
		startBall(view);
		const over = pointerPlace.value ?? present?.over;
		// Who asked for a ball with the pointer on it means that place; elsewhere a click says where.
		if (over?.view === view.key) drawAt(view, over.at);
		return;
	}
	startMarking(view, marking);
}

/** Draw what is being drawn at a place of a view. @param {ViewJson} view @param {PointJson} at */
export function drawAt(view, at) {
	const present = drawing.value;
	if (!present || present.view !== view.key || !group.value || !within(view, at)) return;
	if (present.what === 'ball') {
		submit(sized(view, at));
		selected.value = { kind: 'ball', view: view.key };
		endDrawing();
	} else if (present.what === 'line') {
		putPoint(view, present.marking, at);
	}
}

/** A new ball, as large as a ball looks at the distance at which the other views see it. @param {ViewJson} view @param {PointJson} at */
function sized(view, at) {
	const shown = /** @type {GroupDocument} */ (group.value);
	const edit = newBall(view, at, expectedDiameter(shown, solution.value, view));
	const then = solution.value && previewBall(applyEdit(shown, edit), solution.value).views.find((one) => one.view === view.key);
	const diameter = then?.included ? then.ball?.optimized_diameter_px : null;
	return diameter ? newBall(view, at, diameter) : edit;
}

/** Draw at the place that the person has chosen, by pointer or by the cross. */
export function drawHere() {
	const view = group.value?.views.find(({ key }) => key === drawing.value?.view);
	if (!view) return;
	const at = chosenPlace(view);
	if (at) drawAt(view, at);
	else explain(BY_KEYS);
}

/** Where the cross of a person without a pointer begins: at the 3D ball, at the ends of the projected line, else in the middle. @param {ViewJson} view */
function likelyPlace(view) {
	const solved = solution.value?.views.find((one) => one.view === view.key);
	const { what = 'ask', marking = '' } = drawing.value ?? {};
	const [place] = what === 'ball' ? [solved?.expected?.place] : [nextOn(solved?.calibration.markings.find((one) => one.marking === marking)?.polyline ?? [], view.lines[marking]?.length ?? 0)];
	if (place) return { x: place[0], y: place[1] };
	return { x: (view.width - 1) / 2, y: (view.height - 1) / 2 };
}

/** The first point goes to one end, the second to the other, then the middle. @param {[number, number][]} polyline @param {number} drawn */
function nextOn(polyline, drawn) {
	return [polyline[0], polyline.at(-1)][drawn] ?? polyline[Math.floor(polyline.length / 2)];
}

/**
 * Put a point on the line under a place.
 *
 * @param {ViewJson} view @param {Viewport} viewport @param {ScreenPoint} place
 */
export function insertAt(view, viewport, place) {
	const at = toImage(viewport, place);
	const marking = markingAt(view, at, REACH / viewport.scale);
	if (marking) putPoint(view, marking, at);
	else explain('There is no line here.');
}

/** @param {ViewJson} view @param {string} marking @param {PointJson} at */
function putPoint(view, marking, at) {
	const { edit, index } = addPoint(view, marking, at);
	submit(edit);
	selected.value = { kind: 'point', view: view.key, marking, index };
	const drawn = group.value?.views.find(({ key }) => key === view.key) ?? view;
	if (drawing.value?.view === view.key) setCross(drawn, likelyPlace(drawn));
}

/** @param {ViewJson} view @param {PointJson} at */
function within(view, { x, y }) {
	return x >= -0.5 && y >= -0.5 && x <= view.width - 0.5 && y <= view.height - 0.5;
}
