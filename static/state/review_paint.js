// @ts-check
/** The paint of a group's views, read while its whiskers are shown; kept for as long as the lines are the same. */

import { readPaint } from '../api/paint.js';
import { ApiError } from '../api/problem.js';
import { Kept } from '../lib/kept.js';
import { complain } from './notice.js';

/** @import {GroupDocument, ViewJson} from '../api/types.js' */
/** @import {PaintJson} from '../api/paint.js' */

/** @typedef {ReadonlyMap<string, PaintJson>} KnownPaint by key of the view */

/** @type {Kept<string, PaintJson>} */
const kept = new Kept(60);

/** @param {GroupDocument} group @param {ViewJson} view */
function keyOf(group, view) {
	return JSON.stringify([view.id, view.lines, view.station, group.pitch]);
}

/**
 * Read the paint of every view that has a frame, one after the other.
 *
 * @param {GroupDocument} group as saved
 * @param {AbortSignal} signal
 * @param {(known: KnownPaint) => void} tell called with all that is known so far
 */
export async function readAllPaint(group, signal, tell) {
	/** @type {Map<string, PaintJson>} */
	const known = new Map();
	for (const view of group.views.filter(({ image }) => image)) {
		const key = keyOf(group, view);
		const found = kept.get(key) ?? await read(view, signal);
		if (signal.aborted) return;
		if (!found) continue;
		kept.set(key, found);
		known.set(view.key, found);
		tell(new Map(known));
	}
}

/** @param {ViewJson} view @param {AbortSignal} signal @returns {Promise<PaintJson | null>} */
async function read(view, signal) {
	try {
		return await readPaint(view.id, {}, signal);
	} catch (error) {
		if (signal.aborted) return null;
		if (!(error instanceof ApiError)) throw error;
		complain(`The paint of view ${view.letter} cannot be read: ${error.message}`);
		return null;
	}
}
