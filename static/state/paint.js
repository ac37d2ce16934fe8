// @ts-check
/** The paint of the view in hand: what its frame shows near the lines as they are staged. */

import { computed, effect, signal } from '@preact/signals';

import { proposeLines, readPaint } from '../api/paint.js';
import { ApiError } from '../api/problem.js';
import { linesOntoPaint, ontoPaint, reachOf } from '../geometry/paint.js';
import { pixelText, plural } from '../lib/format.js';
import { latest } from '../lib/latest.js';
import { page } from '../lib/router.js';
import { changed, changes, lines, shownSolution, staging, stageLines, view } from './calibration.js';
import { sameLines } from './line_changes.js';
import { announce, complain, explain } from './notice.js';
import { besideDrawn, leavesOpen } from './proposal_lines.js';
import { proposals } from './proposals.js';
import { linesOf, PROPOSED } from './staging.js';

/** @import {LinesJson, ViewJson} from '../api/types.js' */
/** @import {PaintJson} from '../api/paint.js' */
/** @import {ImagePoint} from '../geometry/viewport.js' */

const INTERVAL = 300;

/** Whether the paint is drawn over the picture. */
export const paintShown = signal(false);
/** What is being asked of the frame. */
export const asking = signal(/** @type {'paint' | 'lines' | null} */ (null));

const read = signal(/** @type {{view: number, lines: LinesJson, paint: PaintJson} | null} */ (null));
const staged = computed(() => linesOf(staging.value));

/** What was read of the view in hand last; of lines that have moved a little since, too. */
export const paint = computed(() => (read.value?.view === view.value?.id ? read.value?.paint ?? null : null));
/** Whether it belongs to the lines as they are staged. */
export const isPaintCurrent = computed(() => (
	read.value?.view === view.value?.id && read.value !== null && sameLines(read.value.lines, staged.value)
));

/** @param {ViewJson} at @param {AbortSignal} [abort] @returns {Promise<PaintJson | null>} null: it cannot be read, which was said */
async function ask(at, abort) {
	const wanted = staged.value;
	asking.value = 'paint';
	try {
		const found = await readPaint(at.id, changes.value, abort);
		read.value = { view: at.id, lines: wanted, paint: found };
		return found;
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`The paint cannot be read: ${error.message}`);
		return null;
	} finally {
		asking.value = null;
	}
}

const following = latest(INTERVAL, async (/** @type {ViewJson} */ at, abort) => { await ask(at, abort); });

/** Read the paint anew as the lines change, while it is shown. @returns {() => void} */
export function followPaint() {
	const stop = effect(() => {
		const at = view.value;
		const wanted = page.value.page === 'calibration' && paintShown.value && Boolean(at?.image);
		if (wanted && at && !isPaintCurrent.value) following.run(at);
		else following.cancel();
	});
	return () => { stop(); following.cancel(); };
}

export function togglePaint() {
	paintShown.value = !paintShown.value;
	announce(paintShown.value ? 'Paint shown.' : 'Paint hidden.');
}

/**
 * Move the points of all markings, or of one, onto their paint: one staged step.
 *
 * @param {string | null} [only]
 */
export async function snapToPaint(only = null) {
	const at = view.value;
	if (!at || asking.value === 'lines') return;
	if (!lines.value[only ?? ''] && (only !== null || Object.keys(lines.value).length === 0)) {
		explain('There are no points to move onto the paint.');
		return;
	}
	const before = lines.value;
	const found = isPaintCurrent.value ? paint.value : await ask(at);
	if (!found) return;
	if (view.value?.id !== at.id || !sameLines(before, lines.value)) {
		explain('The lines have changed meanwhile: nothing was moved.');
		return;
	}
	if (found.reason === 'paint_disagrees' || Object.keys(found.points).length === 0) {
		complain(`Nothing was moved. ${found.sentence || 'No paint is seen near the lines.'}`);
		return;
	}
	stage(linesOntoPaint(before, found.points, reachOf(at.width), only), only);
}

/** @param {ReturnType<typeof linesOntoPaint>} snapped @param {string | null} only */
function stage({ lines: next, moved, left }, only) {
	const stayed = left ? `; ${plural(left, 'point')} without paint nearby ${left === 1 ? 'was' : 'were'} not moved` : '';
	if (moved.length === 0) {
		explain(`Nothing was moved${stayed}.`);
		return;
	}
	stageLines(next, only ? `${only} moved onto the paint` : 'Points moved onto the paint');
	const median = [...moved].sort((a, b) => a - b)[moved.length >> 1];
	announce(`${plural(moved.length, 'point')} moved onto the paint, median move ${pixelText(median)}${stayed}.`);
}

/** Where a point that is dragged lies on the paint of its marking; where there is none, where it is. */
/** @param {string} marking @param {ImagePoint} point @returns {ImagePoint} */
export function drawnToPaint(marking, point) {
	const at = view.value;
	const known = paint.value;
	if (!at || !known || known.reason === 'paint_disagrees') return point;
	return ontoPaint(point, known.points[marking], reachOf(at.width)) ?? point;
}

/** Have the paint at hand before a point is drawn to it. */
export function fetchPaint() {
	const at = view.value;
	if (at?.image && !isPaintCurrent.value && asking.value === null) ask(at);
}

/** Whether the lines as they are staged wait for others: there are none, or they determine no camera. */
export const isWaiting = computed(() => {
	const solved = shownSolution.value?.views.find(({ view: key }) => key === view.value?.key);
	return Object.keys(lines.value).length === 0 || leavesOpen(solved?.calibration);
});

/** Stage lines from the paint beside those that are there, as long as they determine no camera. */
export async function proposeFromPaint() {
	const at = view.value;
	if (!at || asking.value !== null) return;
	if (!isWaiting.value) {
		explain('Lines are proposed only while a view has no camera; this view has one.');
		return;
	}
	const known = proposals.peek().get(at.key);
	if (known?.outcome === 'proposed' && !changed.value) {
		stageProposed(known);
		return;
	}
	asking.value = 'lines';
	const before = lines.value;
	try {
		const found = await proposeLines(at.id, changes.value);
		if (view.value?.id !== at.id) return;
		if (!sameLines(before, lines.value)) explain('The lines have changed meanwhile: nothing was proposed.');
		else if (found.outcome !== 'proposed') complain(`No lines are proposed. ${found.sentence}`);
		else stageProposed(found);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`Nothing can be proposed: ${error.message}`);
	} finally {
		asking.value = null;
	}
}

/** @param {{lines: LinesJson, sentence: string}} proposed */
function stageProposed({ lines: proposed, sentence }) {
	const there = Object.keys(lines.value).length > 0;
	const { all, added } = besideDrawn(lines.value, proposed);
	stageLines(all, 'Lines proposed from the paint', PROPOSED);
	const next = there ? 'Lines already drawn are kept; check, then save.' : 'Check left and right, then save. Swap sides (M) exchanges them.';
	announce(`${plural(added.length, 'marking')} proposed. ${sentence ? `${sentence} ` : ''}${next}`);
}
