// @ts-check
/** Carrying out what mends a group: the edit itself, or leading the person to the place where to draw. */

import { squareBox } from '../geometry/ball.js';
import { framePoints } from '../geometry/frame_points.js';
import { ballCenter, ballOf } from '../geometry/preview.js';
import { raysInto } from '../overlays/scene.js';
import { placeBall } from '../state/ball_edits.js';
import { startBall, startMarking } from '../state/drawing.js';
import { group, pending, solution, submit } from '../state/group.js';
import { mend } from '../state/mends.js';
import { announce } from '../state/notice.js';
import { zoomTo } from '../state/viewports.js';
import { focusView, selected } from '../state/workspace.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {ImagePoint} from '../geometry/viewport.js' */
/** @import {Edit} from '../state/edits.js' */
/** @import {Mend} from '../state/mends.js' */

/** Screen pixels per image pixel where a ball is looked for. */
const BALL_SCALE = 8;
/** And for a marking at most, however short it is. */
const LINE_SCALE = 12;

/** Most balls are no higher, metres above the grass. */
const LIKELY_HEIGHT = 3;

/** Size of the panel of a view, CSS pixels. @param {string} letter */
function panelOf(letter) {
	const stage = document.querySelector(`.image-panel[data-view="${letter}"] .image-panel__stage`);
	return stage?.getBoundingClientRect() ?? null;
}

/** Bring some points of a view into sight. @param {ViewJson} view @param {ImagePoint[]} points @param {number} most */
function showPlace(view, points, most = BALL_SCALE) {
	if (points.length === 0) return;
	// A view that was not on screen is there with the next frame.
	requestAnimationFrame(() => {
		const panel = panelOf(view.letter);
		if (!panel) return;
		const { center, scale } = framePoints(points, panel, most);
		zoomTo(view.letter, panel, center, scale);
	});
}

/** Put the ball where the other views see it. @param {ViewJson} view @returns {boolean} whether that is known */
export function placeExpected(view) {
	const expected = solution.value?.views.find((one) => one.view === view.key)?.expected;
	const edit = expected ? placeBall(view, expected) : null;
	if (!edit) return false;
	submit(edit);
	focusView(view.letter);
	selected.value = { kind: 'ball', view: view.key };
	announce(`Ball of ${view.letter} placed where the other views see it. It confirms nothing until you move it.`);
	return true;
}

/** @param {ViewJson} view @param {string} marking */
function drawMissing(view, marking) {
	const fit = solution.value?.views.find((one) => one.view === view.key)?.calibration.markings.find((one) => one.marking === marking);
	startMarking(view, marking);
	showPlace(view, (fit?.polyline ?? []).map(([x, y]) => ({ x, y })), LINE_SCALE);
}

/** Give the box of a ball the size that it has at its distance. @param {ViewJson} view */
function fitBox(view) {
	const ball = ballOf(view);
	const diameter = solution.value?.views.find((one) => one.view === view.key)?.ball?.optimized_diameter_px;
	const center = ball && ballCenter(ball);
	if (!ball?.box || !center || !diameter) return;
	submit({ kind: 'ball', view: view.key, ball: { ...ball, box: squareBox(center, diameter) } });
}

/** An edit of the server builds on what it has: not on a change of the same lines or ball that is still on its way. @param {Edit} edit */
function submitOffered(edit) {
	const waits = edit.kind !== 'include' && pending.value.some(({ kind, view }) => kind === edit.kind && view === edit.view);
	if (waits) announce('Your last change here is not saved yet. Try again in a moment.');
	else submit(edit);
}

/** @param {Mend} wanted */
export function carryOut({ fix, edit }) {
	const shown = group.value;
	const view = shown?.views.find(({ key }) => key === fix.view);
	if (!shown || !view) return;
	focusView(view.letter);
	if (edit) submitOffered(edit);
	else if (fix.action === 'place_ball') placeExpected(view);
	else if (fix.action === 'draw_ball') {
		const along = raysInto(shown, solution.value, view, LIKELY_HEIGHT).filter(({ x, y }) => x >= 0 && y >= 0 && x < view.width && y < view.height);
		startBall(view, along[Math.floor(along.length / 2)]);
		showPlace(view, along);
	}
	else if (fix.action === 'draw_marking' && fix.marking) drawMissing(view, fix.marking);
	else if (fix.action === 'resize_ball') fitBox(view);
	else if (fix.action === 'read_paint') import('../state/paint_reading.js').then(({ readAgain }) => readAgain(shown));
	else if (fix.action === 'accept_proposal') import('../state/proposals.js').then(({ acceptProposal }) => acceptProposal(view));
	else if (fix.action === 'look_ball' && fix.point) {
		showPlace(view, [{ x: fix.point[0], y: fix.point[1] }]);
		selected.value = { kind: 'ball', view: view.key };
		announce('The ring is where the ball would have to be. If you see the ball there, move its box.');
	}
}

/** Carry out what the card shows. */
export function mendNow() {
	if (mend.value) carryOut(mend.value);
}
