// @ts-check
/** The state of one view as a grade and a few words. */

import { diagonal } from '../geometry/preview.js';
import { gradeBelow, gradeOfJac } from '../geometry/residual.js';
import { pixelText, sharePercent } from '../lib/format.js';
import { leftOutText } from '../state/reasons.js';

/** @import {GroupDocument, PolicyJson, SolutionJson, ViewJson, ViewSolutionJson} from '../api/types.js' */
/** @import {Grade} from '../geometry/residual.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

const FAILED = /** @type {Record<string, string>} */ ({
	calibratable: 'no camera', jac: 'lines do not fit', agreement: 'paint contradicts the camera', ball: 'no ball', reprojection: '', baseline: 'too close to another camera',
});

/** Why the camera is that of the clicks. */
const REASONS = /** @type {Record<string, string>} */ ({
	no_paint: 'too little paint', paint_disagrees: 'paint disagrees', no_frame: 'no picture',
});

/** JaC at 0.5 %, or null when it was not measured. @param {ViewSolutionJson | null} solved */
export function jacOf(solved) {
	return solved?.calibration.jac?.['0.5'] ?? null;
}

/**
 * How the camera and the paint of its picture agree, or null where none was read for its lines, nor since the group is shown.
 *
 * @param {ViewSolutionJson | null} solved @param {import('../api/paint.js').PaintJson | undefined} [read] what was read of the picture while the group is shown
 * @returns {{supported: string, explained: string, reason: string} | null} shares or –, and why the camera is that of the clicks
 */
export function paintOf(solved, read) {
	const fit = solved?.calibration.paint ?? read;
	if (!fit) return null;
	const share = (/** @type {number | null} */ value) => (value === null ? '–' : sharePercent(value));
	const reason = fit.reason === null ? '' : REASONS[fit.reason] ?? fit.reason;
	return { supported: share(fit.supported), explained: share(fit.explained), reason };
}

/**
 * Views that count although their lines do not determine their camera, and what of it is a guess.
 *
 * @param {GroupDocument} group @param {SolutionJson | null} solution
 * @returns {{view: ViewJson, guess: string}[]}
 */
export function uncertainViews(group, solution) {
	return group.views.flatMap((view) => {
		const guess = guessOf(solution?.views.find((one) => one.view === view.key) ?? null);
		return view.included && guess ? [{ view, guess }] : [];
	});
}

/** What the lines leave open of a camera that was found: "position", or "". @param {ViewSolutionJson | null} solved */
function guessOf(solved) {
	const { camera, unobservable = [] } = solved?.calibration ?? {};
	return camera ? unobservable.join(' and ') : '';
}

/** @param {Pick<ViewPicture, 'view' | 'solved' | 'ball' | 'apart' | 'tau'>} picture @returns {{grade: Grade, sentence: string}} */
export function gradeOfView(picture) {
	const { view, solved, apart, tau } = picture;
	if (!view.included) return { grade: 'unseen', sentence: leftOutText(view.left_out) };
	if (!solved) return { grade: 'unseen', sentence: 'not solved' };
	if (!solved.calibration.camera) return { grade: 'bad', sentence: 'no camera' };
	const guess = guessOf(solved) && 'uncertain';
	const given = solved.calibration.source === 'given' && jacOf(solved) === null ? 'camera given' : '';
	if (solved.failed) return { grade: 'bad', sentence: FAILED[solved.failed] ?? solved.failed };
	if (!view.balls.length) return { grade: 'warn', sentence: guess || 'no ball' };
	if (view.balls.some(({ inferred }) => inferred)) return { grade: 'warn', sentence: 'ball placed, not counted' };
	// A ball that no other view confirms is not well, wherever the camera comes from.
	const error = errorOf(picture).px;
	if (error !== null && error > tau) return { grade: 'bad', sentence: guess || given };
	// What is wrong is not to be seen in this view: it has nobody to agree with.
	if (apart !== null || (solved.ball && !solved.included)) return { grade: 'warn', sentence: 'no matching view' };
	return guess ? { grade: 'warn', sentence: guess } : { grade: 'ok', sentence: given };
}

/** What an error of the ball in a view is measured from. */
const FROM = { ball: 'from the 3D ball', pair: 'in its best pair', others: 'from the 3D ball of the others' };

/**
 * The ball's error in a view: to the 3D ball, or where the view agrees with no other, in its best pair.
 *
 * @param {Pick<ViewPicture, 'view' | 'solved' | 'ball' | 'apart'>} picture
 * @returns {{px: number | null, percent: number | null, from: 'ball' | 'pair' | 'others'}} `from`: what it is measured from
 */
export function errorOf({ view, solved, ball, apart }) {
	const px = apart ?? ball?.error_px ?? null;
	const from = apart !== null ? 'pair' : solved?.included === false ? 'others' : 'ball';
	return { px, percent: px === null ? null : (100 * px) / diagonal(view), from };
}

/**
 * Both errors of a view that the 3D ball does without, so that neither is taken for the other; '' of one that it is made of.
 *
 * @param {Pick<ViewPicture, 'solved' | 'ball' | 'apart' | 'tau'>} picture
 */
export function unusedErrors({ solved, ball, apart, tau }) {
	const far = ball?.error_px ?? null;
	if (!solved || solved.included || far === null) return '';
	const counts = apart !== null && apart <= tau ? ', which does not count' : '';
	return `${apart === null ? '' : `${pixelText(apart)} ${FROM.pair}${counts}; `}${pixelText(far)} ${FROM.others}`;
}

/** @param {ViewPicture} picture @param {PolicyJson} policy */
export function gradesOf(picture, policy) {
	return {
		jac: gradeOfJac(jacOf(picture.solved), policy.min_jac),
		error: gradeBelow(errorOf(picture).percent, policy.tau_percent),
	};
}
