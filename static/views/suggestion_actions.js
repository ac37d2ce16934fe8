// @ts-check
/** Carrying out what corrects a group: the edit itself, or leading the person to the place where to draw. */

import { framePoints } from '../geometry/frame_points.js';
import { raysInto } from '../overlays/scene.js';
import { startBall, startMarking } from '../state/drawing.js';
import { group, pending, solution, submit } from '../state/group.js';
import { suggestion } from '../state/suggestions.js';
import { explain } from '../state/notice.js';
import { zoomTo } from '../state/viewports.js';
import { focusView, selected } from '../state/workspace.js';

/** @import {GroupDocument, PairJson, ViewJson} from '../api/types.js' */
/** @import {ImagePoint} from '../geometry/viewport.js' */
/** @import {Edit} from '../state/edits.js' */
/** @import {Suggestion} from '../state/suggestions.js' */

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

/** @param {ViewJson} view @param {string} marking */
function drawMissing(view, marking) {
	const fit = solution.value?.views.find((one) => one.view === view.key)?.calibration.markings.find((one) => one.marking === marking);
	startMarking(view, marking);
	showPlace(view, (fit?.polyline ?? []).map(([x, y]) => ({ x, y })), LINE_SCALE);
}

/** @param {GroupDocument} shown @param {ViewJson} view */
function drawBall(shown, view) {
	const along = raysInto(shown, solution.value, view, LIKELY_HEIGHT).filter(({ x, y }) => x >= 0 && y >= 0 && x < view.width && y < view.height);
	startBall(view, along[Math.floor(along.length / 2)]);
	showPlace(view, along);
}

/** @param {ViewJson} view @param {PairJson} place */
function lookThere(view, [x, y]) {
	showPlace(view, [{ x, y }]);
	selected.value = { kind: 'ball', view: view.key };
	explain('The ring is where the ball would have to be. If you see the ball there, move its box.');
}

/** An edit of the server builds on what it has: not on a change of the same lines or ball that is still on its way. @param {Edit} edit */
function submitOffered(edit) {
	const waits = edit.kind !== 'include' && pending.value.some(({ kind, view }) => kind === edit.kind && view === edit.view);
	if (waits) explain('Your last change here is not saved yet. Try again in a moment.');
	else submit(edit);
}

/** @param {GroupDocument} shown @param {ViewJson} view @param {NonNullable<Suggestion['guide']>} guide */
function lead(shown, view, { ball, draws, looks, reads }) {
	if (ball) drawBall(shown, view);
	if (draws) drawMissing(view, draws);
	if (looks) lookThere(view, looks);
	if (reads) import('../state/paint_reading.js').then(({ readAgain }) => readAgain(shown));
}

/** @param {Suggestion} wanted */
export function carryOut({ view: key, edit, guide, run }) {
	const shown = group.value;
	const view = shown?.views.find((one) => one.key === key);
	if (!shown || !view) return;
	focusView(view.letter);
	if (edit) submitOffered(edit);
	if (guide) lead(shown, view, guide);
	run?.(view);
}

/** Carry out what the card shows. */
export function applySuggestion() {
	if (suggestion.value) carryOut(suggestion.value);
}
