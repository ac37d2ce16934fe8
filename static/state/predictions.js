// @ts-check
/**
 * Predictions of the group on screen. They are asked for when a group has stood for a moment, so
 * that neither its first picture nor the way to the next group waits for them, and kept for a while.
 */

import { computed, effect, signal, untracked } from '@preact/signals';

import { getGroupPredictions } from '../api/evaluations.js';
import { ApiError } from '../api/problem.js';
import { plural } from '../lib/format.js';
import { Kept } from '../lib/kept.js';
import { page } from '../lib/router.js';
import { stored } from '../lib/storage.js';
import { group, groupDocument, submit } from './group.js';
import { announce, complain, explain } from './notice.js';
import { acceptEdit, acceptEdits, marksOf, setNames, setToShow, surest } from './prediction_marks.js';
import { wasRefused } from './sending.js';
import { boxes, focused, overlaysHidden, selected } from './workspace.js';

/** @import {GroupPredictionsJson} from '../api/evaluations.js' */
/** @import {GroupDocument, ViewJson} from '../api/types.js' */
/** @import {Mark, ViewMarks} from './prediction_marks.js' */

/** @typedef {{group: number, sets: string[], set: string, views: Map<string, ViewMarks>}} Predicted */
/** @typedef {{at: number, balls: string, found: GroupPredictionsJson}} Answer */

/** How long a group stands before it is asked about, ms. */
const PAUSE = 120;
/** How long an answer is believed without another look, ms. */
const FRESH = 30_000;

/** Name of the set that is shown, or `EVERY_SET`; "": the newest. */
export const shownSet = stored('prediction-set', '');
/** Less sure predictions are dotted, and taken only when somebody points at them. */
export const leastScore = stored('prediction-score', 0.25);

/** @type {Kept<number, Answer>} */
const kept = new Kept(48);
/** Datasets without predictions, and since when that is known. @type {Map<number, number>} */
const without = new Map();
const answered = signal(/** @type {{group: number, found: GroupPredictionsJson} | null} */ (null));
const forgotten = signal(0);

/** @param {GroupDocument | null} at */
function ballsOf(at) {
	return JSON.stringify((at?.views ?? []).map(({ balls }) => balls.map((ball) => (
		ball.predicted_by ? [ball.predicted_by, ball.box] : 0
	))));
}

/** Only what this says of the balls matters here: a drag does not change it at every step. */
const balls = computed(() => ballsOf(group.value));

/** What was predicted for the group on screen; null where nothing was, or is known yet. */
export const predicted = computed(() => {
	const found = answered.value?.found;
	// Read before anything is decided: the computed follows it.
	const present = balls.value && group.peek();
	if (!found || !present || answered.value?.group !== present.id) return null;
	const sets = setNames(found);
	if (sets.length === 0 && found.accepted.length === 0) return null;
	const set = setToShow(found, shownSet.value);
	return { group: present.id, sets, set, views: marksOf(found, present, { set, least: leastScore.value }) };
});

/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;
let controller = new AbortController();

/** Ask about whatever group is on screen, from now on; once. */
export const startPredictions = once(() => {
	const id = computed(() => (page.value.page === 'review' ? groupDocument.value?.id : undefined));
	const saved = computed(() => ballsOf(groupDocument.value));
	effect(() => {
		forgotten.value;
		saved.value;
		id.value;
		untracked(follow);
	});
	// Who refused an acceptance knows more than we do: a set may be gone.
	effect(() => { if (wasRefused.value) untracked(forgetPredictions); });
});

/** @param {() => void} work */
function once(work) {
	let done = false;
	return () => {
		if (done) return;
		done = true;
		work();
	};
}

/** Believe no answer any more: sets came or went, or many were accepted. */
export function forgetPredictions() {
	kept.clear();
	without.clear();
	forgotten.value += 1;
}

/** Show what is known of the group on screen, and ask where that is not enough. */
function follow() {
	clearTimeout(timer);
	controller.abort();
	controller = new AbortController();
	const at = groupDocument.value;
	if (!at || page.value.page !== 'review') {
		answered.value = null;
		return;
	}
	const known = kept.get(at.id);
	const shown = answered.value?.group === at.id;
	if (known || !shown) answered.value = known ? { group: at.id, found: known.found } : null;
	const now = performance.now();
	if (known && known.balls === ballsOf(at) && now - known.at < FRESH) return;
	if (now - (without.get(at.dataset.id) ?? -Infinity) < FRESH) return;
	timer = setTimeout(ask, PAUSE, at, controller.signal);
}

/** @param {GroupDocument} at @param {AbortSignal} abort */
async function ask(at, abort) {
	try {
		const found = await getGroupPredictions(at.id, abort);
		if (abort.aborted) return;
		if (found.sets === 0) without.set(at.dataset.id, performance.now());
		kept.set(at.id, { at: performance.now(), balls: ballsOf(at), found });
		if (groupDocument.value?.id === at.id) answered.value = { group: at.id, found };
	} catch (error) {
		// Another group came, or the server is away: the group can be reviewed without.
		if (!abort.aborted && !(error instanceof ApiError)) throw error;
	}
}

/** @param {ViewJson} view @returns {Mark[]} */
function marksIn(view) {
	return predicted.value?.views.get(view.key)?.marks ?? [];
}

/** What is not seen is not accepted. */
function isHidden() {
	if (boxes.value && !overlaysHidden.value) return false;
	complain(`Predictions are hidden. Press ${boxes.value ? 'H' : 'B'} to see what you would accept.`);
	return true;
}

/**
 * Make a prediction the ball of its view; a view that has one keeps it until that is asked for.
 *
 * @param {ViewJson} view @param {Mark} mark @param {boolean} [replace]
 */
export function acceptMark(view, mark, replace = false) {
	if (isHidden()) return;
	if (view.balls.length > 0 && !replace) {
		complain(`View ${view.letter} has a ball already. Delete it first, or replace it by the prediction.`, {
			label: 'Replace it', run: () => acceptMark(view, mark, true),
		});
		return;
	}
	submit(acceptEdit(view, mark, replace));
	selected.value = { kind: 'ball', view: view.key };
	focused.value = view.letter;
}

/** Accept the selected prediction, else the surest one of the view in hand. */
export function acceptInHand() {
	const object = selected.value;
	const view = group.value?.views.find(({ key, letter }) => (object ? key === object.view : letter === focused.value));
	if (!view) return;
	const marks = marksIn(view);
	const mark = object?.kind === 'prediction' ? marks.find(({ id }) => id === object.prediction) : surest(marks);
	if (mark) acceptMark(view, mark);
	else if (marks.length) explain(`No prediction in view ${view.letter} is above the threshold: select one to accept it.`);
	else explain(`There is no prediction in view ${view.letter}.`);
}

/** Give every view of the group that has no ball its surest prediction; each is an edit of its own. */
export function acceptAll() {
	const present = group.value;
	const shown = predicted.value;
	if (!present || !shown || isHidden()) return;
	const edits = acceptEdits(present, shown.views);
	for (const edit of edits) submit(edit);
	if (edits.length) announce(`${plural(edits.length, 'prediction')} accepted.`);
	else explain('Every view with a prediction above the threshold has a ball already.');
}
