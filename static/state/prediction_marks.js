// @ts-check
/** Which predictions of a view are worth a mark, and what accepting one of them says. */

import { ballCenter, ballOf } from '../geometry/preview.js';
import { boxCenter } from '../geometry/ball.js';
import { isFollowed } from './edits.js';

/** @import {AcceptedJson, GroupPredictionsJson, PredictionJson} from '../api/evaluations.js' */
/** @import {BallJson, GroupDocument, ViewJson} from '../api/types.js' */
/** @import {BallEdit} from './edits.js' */

/**
 * @typedef {object} Mark one predicted ball that is drawn
 * @property {number} id
 * @property {string} name of its set
 * @property {number} score
 * @property {boolean} scored whether its set has scores: without one nobody knows how sure it is
 * @property {[number, number, number, number]} box
 * @property {boolean} sure the surest one of its set in the view, and sure enough
 */
/** @typedef {{marks: Mark[], fewer: number, origin: string | null}} ViewMarks   fewer: marks left out; origin: of an accepted ball */
/** @typedef {{set: string, least: number}} Choice   name of the set that is shown, "" for all; least score that counts as sure */

/** Boxes that one set may put on one view. */
const MOST = 5;

/**
 * What stands on each view of a group, by key of the view.
 *
 * @param {GroupPredictionsJson} found @param {GroupDocument} group as shown @param {Choice} choice
 * @returns {Map<string, ViewMarks>}
 */
export function marksOf(found, group, choice) {
	return new Map(group.views.map((view) => {
		const own = found.items.filter((item) => item.view === view.id);
		const shown = own.filter(({ name }) => choice.set === '' || name === choice.set);
		const sets = [...new Set(shown.map(({ predictions }) => predictions))];
		const kept = sets.flatMap((set) => ofSet(shown.filter(({ predictions }) => predictions === set), choice.least));
		const marks = kept.filter((mark) => !isTaken(view, mark));
		const accepted = found.accepted.find((one) => one.view === view.id) ?? null;
		return [view.key, { marks, fewer: shown.length - kept.length, origin: originOf(view, own, accepted) }];
	}));
}

/** @param {PredictionJson[]} items of one set, the surest first @param {number} least @returns {Mark[]} */
function ofSet(items, least) {
	return items.slice(0, MOST).map(({ id, name, score, scored, box }, place) => (
		{ id, name, score, scored, box, sure: place === 0 && scored && score >= least }
	));
}

/** Whether the view's ball is this very prediction. @param {ViewJson} view @param {{name: string, box: readonly number[]}} mark */
function isTaken(view, { name, box }) {
	return view.balls.some((ball) => ball.predicted_by === name && String(ball.box) === String(box));
}

/**
 * Where the view's ball comes from, in words; null where no prediction was accepted.
 *
 * @param {ViewJson} view @param {PredictionJson[]} items
 * @param {AcceptedJson | null} said by the server, which does not know yet what is on its way there
 * @returns {string | null}
 */
function originOf(view, items, said) {
	const name = ballOf(view)?.predicted_by;
	if (!name) return null;
	const known = said?.name === name ? said : null;
	const score = known?.score ?? items.find((item) => isTaken(view, item))?.score ?? null;
	const parts = [isFollowed(name) ? name : `predicted by ${name}`];
	if (score !== null) parts.push(`score ${score.toFixed(2)}`);
	if (known?.by) parts.push(`accepted by ${known.by}`);
	return parts.join(', ');
}

/** The surest of the marks that are sure. @param {readonly Mark[]} marks @returns {Mark | null} */
export function surest(marks) {
	return marks.filter(({ sure }) => sure).sort((a, b) => b.score - a.score)[0] ?? null;
}

/** The sets that have something to show here, the newest first. @param {GroupPredictionsJson} found @returns {string[]} */
export function setNames(found) {
	return [...new Set(found.items.map(({ name }) => name))];
}

/** What stands for all sets where one may be chosen. */
export const EVERY_SET = '*';

/**
 * The set to show: the chosen one where it is here, else the newest with scores.
 *
 * @param {GroupPredictionsJson} found @param {string} chosen
 * @returns {string} "" for all
 */
export function setToShow(found, chosen) {
	if (chosen === EVERY_SET) return '';
	const names = setNames(found);
	if (names.includes(chosen)) return chosen;
	return found.items.find(({ scored }) => scored)?.name ?? names[0] ?? '';
}

/**
 * The edit that makes a prediction the ball of its view.
 *
 * @param {ViewJson} view @param {Mark} mark @param {boolean} replace also where the view has a ball
 * @returns {BallEdit}
 */
export function acceptEdit(view, { id, name, box }, replace) {
	/** @type {BallJson} */
	const ball = { box, point: null, occluded: false, out_of_view: false, source: 'prediction', predicted_by: name };
	return { kind: 'ball', view: view.key, ball, prediction: { id, replace } };
}

/**
 * The edits that give every view without a ball its surest prediction.
 *
 * @param {GroupDocument} group @param {Map<string, ViewMarks>} views
 * @returns {BallEdit[]}
 */
export function acceptEdits(group, views) {
	return group.views.flatMap((view) => {
		const mark = view.balls.length === 0 ? surest(views.get(view.key)?.marks ?? []) : null;
		return mark ? [acceptEdit(view, mark, false)] : [];
	});
}

/** How far a prediction is from the ball that the view has, pixels; null without one. @param {ViewJson} view @param {Mark} mark */
export function distanceTo(view, mark) {
	const ball = ballOf(view);
	const at = ball && ballCenter(ball);
	if (!at) return null;
	const center = boxCenter(mark.box);
	return Math.hypot(center.x - at.x, center.y - at.y);
}
