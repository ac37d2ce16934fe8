// @ts-check
/** Giving an object back what it was before anybody edited it, from the log of its group. */

import { request } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { group, groupDocument, submit } from './group.js';
import { complain, explain } from './notice.js';
import { selected } from './workspace.js';

/** @import {BallJson, PointJson} from '../api/types.js' */
/** @import {Edit} from './edits.js' */
/** @import {Selection} from './workspace.js' */

/** @typedef {{kind: string, body: any}} Entry */

/** The selected marking or ball as the dataset brought it. */
export async function revertSelected() {
	const object = selected.value;
	const at = groupDocument.value;
	if (!object || object.kind === 'prediction' || !at) {
		explain('Select a point or a ball first.');
		return;
	}
	try {
		const { items } = await request(`/groups/${at.id}/history`);
		if (groupDocument.value?.id === at.id) revert(object, items);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`Not reset: ${error.message}`);
	}
}

/** @param {Selection} object @param {Entry[]} entries */
function revert(object, entries) {
	const edit = originalOf(object, entries);
	if (edit === null) explain('Nothing to reset: this object was never edited.');
	else if (edit === 'several') complain('The imported data has several balls in this view: use undo to restore them.');
	else if (group.value) {
		selected.value = object.kind === 'ball' ? object : null;
		submit(edit);
	}
}

/**
 * The edit that leads back to what the first edit of an object found.
 *
 * @param {Selection} object @param {Entry[]} entries oldest first
 * @returns {Edit | 'several' | null} null when nobody edited it
 */
export function originalOf(object, entries) {
	for (const { body } of entries) {
		const before = body?.inverse;
		if (before?.view !== object.view) continue;
		if (object.kind === 'ball' && before.edit === 'set_balls') return ballEdit(object.view, before.balls);
		if (object.kind === 'point' && before.edit === 'set_lines' && object.marking in before.lines) {
			const points = /** @type {any[] | null} */ (before.lines[object.marking]);
			const lines = { [object.marking]: points?.length ? points.map(pointOf) : null };
			return { kind: 'lines', view: object.view, lines };
		}
	}
	return null;
}

/** @param {string} view @param {any[]} balls @returns {Edit | 'several'} */
function ballEdit(view, balls) {
	if (balls.length > 1) return 'several';
	const [ball] = balls;
	if (!ball) return { kind: 'ball', view, ball: null };
	/** @type {BallJson} */
	const present = {
		box: ball.box ?? null, point: ball.point ?? null,
		occluded: Boolean(ball.occluded), out_of_view: Boolean(ball.out_of_view),
	};
	return { kind: 'ball', view, ball: present };
}

/** The log writes a point as a pair. @param {any} point @returns {PointJson} */
function pointOf(point) {
	return Array.isArray(point) ? { x: point[0], y: point[1] } : { x: point.x, y: point.y };
}
