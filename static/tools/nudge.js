// @ts-check
/** Keys that move the selected object by exact steps; what is typed in one go is one edit. */

import { ballOf } from '../geometry/preview.js';
import { movePoint, viewOf } from '../state/edits.js';
import { draft, group, propose, submit } from '../state/group.js';
import { explain } from '../state/notice.js';
import { selected } from '../state/workspace.js';
import { growBall, moveBall } from './drags.js';

/** @import {Edit} from '../state/edits.js' */

const PAUSE = 350;
const STEPS = { plain: 1, Shift: 5, Alt: 0.1 };
const DIAMETER_STEP = 0.25;

/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/**
 * Move the selected object.
 *
 * @param {number} x -1, 0 or 1 @param {number} y
 * @param {{shiftKey: boolean, altKey: boolean}} event
 */
export function nudge(x, y, { shiftKey, altKey }) {
	const step = altKey ? STEPS.Alt : shiftKey ? STEPS.Shift : STEPS.plain;
	change(moved(x * step, y * step));
}

/** @param {number} dx @param {number} dy @returns {Edit | null} */
function moved(dx, dy) {
	const object = selected.value;
	if (!object || !group.value) return null;
	const view = viewOf(group.value, object.view);
	if (object.kind === 'ball') {
		const ball = ballOf(view);
		return ball && moveBall(view, ball, dx, dy);
	}
	if (object.kind === 'prediction') {
		explain('Accept the prediction first: it cannot be moved before.');
		return null;
	}
	const point = view.lines[object.marking]?.[object.index];
	return point
		? movePoint(view, object.marking, object.index, { x: point.x + dx, y: point.y + dy }) : null;
}

/** Make the selected ball's box larger or smaller. @param {1 | -1} direction */
export function nudgeDiameter(direction) {
	const object = selected.value;
	if (object?.kind !== 'ball' || !group.value) {
		explain('Select a ball first.');
		return;
	}
	const view = viewOf(group.value, object.view);
	const ball = ballOf(view);
	change(ball && growBall(view, ball, direction * DIAMETER_STEP));
}

/** Take the selected point, or ball, away. */
export function deleteSelected() {
	const object = selected.value;
	if (!object || !group.value) {
		explain('Select a point or a ball first.');
		return;
	}
	const view = viewOf(group.value, object.view);
	if (object.kind === 'prediction') {
		explain('A prediction cannot be deleted here. It is not used unless a person accepts it.');
		return;
	}
	selected.value = null;
	if (object.kind === 'ball') submit({ kind: 'ball', view: view.key, ball: null });
	else if (view.lines[object.marking]?.[object.index]) {
		submit(movePoint(view, object.marking, object.index, null));
	}
}

/** @param {Edit | null} edit */
function change(edit) {
	if (!edit) return;
	propose(edit);
	clearTimeout(timer);
	timer = setTimeout(() => { if (draft.value === edit) submit(edit); }, PAUSE);
}
