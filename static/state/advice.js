// @ts-check
/** What to make of a solution: its findings in a few words, and the reason for which a group would be rejected. */

import { capital, words } from '../lib/format.js';
import { openFindings } from './open_findings.js';

/** @import {FindingJson, GroupDocument, SolutionJson} from '../api/types.js' */

/** Titles of findings; `@` stands for the letter of the view. */
const TITLES = /** @type {Record<string, string>} */ ({
	wrong_label: 'A line of @ has the wrong label',
	sides_swapped: 'Left and right are swapped in @',
	visible_not_annotated: 'A visible line of @ is not drawn',
	bad_point: 'A point of @ lies off its line',
	under_constrained: 'The lines of @ do not determine its camera',
	view_disagrees: 'View @ disagrees with the others',
	views_contradict: 'The views contradict each other',
	not_synchronous: 'The views may show different instants',
	ball_size: 'The ball box in @ has an unlikely size',
	low_parallax: 'The rays are nearly parallel',
	high_uncertainty: 'The position of the ball is uncertain',
	implausible_ball: 'The 3D ball is in an impossible place',
	picture_geometry: 'The picture of @ was stretched or cropped',
	camera_size: 'The camera of @ was made for pictures of another size',
	paint_disagrees: 'The painted and the annotated lines of @ disagree',
	no_paint: 'No painted lines confirm the camera of @',
	implausible_camera: 'The camera of @ is in an impossible place',
	several_balls: 'View @ has several balls',
	upstream_changed: 'The imported file has changed',
	pitch_size: 'The pitch has another size',
	track_disagrees: 'The ball of @ contradicts its track',
});

/** A finding in a few words. @param {GroupDocument} group @param {FindingJson} finding */
export function findingTitle(group, finding) {
	const letter = group.views.find(({ key }) => key === finding.view)?.letter;
	const title = TITLES[finding.kind];
	return title && (letter || !title.includes('@')) ? title.replace('@', letter ?? '') : capital(words(finding.kind));
}

/** Findings that a reason to reject follows from. */
const OF_FINDING = /** @type {Record<string, string>} */ ({
	camera_size: 'bad_calibration', sides_swapped: 'sides_confused', not_synchronous: 'not_same_instant', views_contradict: 'not_same_instant',
});
/** The reason that fits when nothing but the gate is known. */
const OF_GATE = /** @type {Record<string, string>} */ ({
	calibratable: 'bad_field_lines', jac: 'bad_field_lines', agreement: 'bad_field_lines', two_views: 'bad_field_lines', ball: 'ball_not_visible',
	baseline: 'duplicate_view', reprojection: 'not_same_instant', parallax: 'duplicate_view', sigma: 'bad_calibration', chi_square: 'not_same_instant',
});

/**
 * The reason for which a group that cannot be mended would be rejected; null when it passes.
 *
 * @param {SolutionJson | null} solution @returns {string | null} one of the reasons of verdicts
 */
export function suggestedReason(solution) {
	const failing = solution?.first_failing;
	// A view alone fails for want of another one, whatever is drawn in it.
	if (!solution || !failing || solution.views.length < 2) return null;
	const telling = openFindings(solution).find(({ kind }) => OF_FINDING[kind]);
	return (telling && OF_FINDING[telling.kind]) ?? OF_GATE[failing.gate] ?? null;
}

/** Findings that say of views that they do not show one ball. */
const APART = new Set(['view_disagrees', 'views_contradict', 'sides_swapped', 'not_synchronous']);

/** Whether a finding says that views of the ball disagree. @param {FindingJson} finding */
export function saysApart({ kind }) {
	return APART.has(kind);
}

/**
 * Whether a finding is said first, whatever could be mended beside it: nobody can use the ball, or the group passes though its views disagree.
 *
 * @param {FindingJson} finding @param {SolutionJson | null} solution
 */
export function isGrave(finding, solution) {
	return finding.unusable_ball || Boolean(solution?.passes && saysApart(finding));
}

/** What is wrong, without what to do about it. @param {string} text */
function firstSentence(text) {
	const [first] = text.split('. ');
	return first.charAt(0).toLowerCase() + first.slice(1);
}

/**
 * Why a group should not be accepted without a second thought; null when nothing speaks against it.
 *
 * @param {SolutionJson | null} solution @returns {string | null}
 */
export function doubt(solution) {
	const unusable = solution?.findings.find(({ unusable_ball: no }) => no);
	if (unusable) return `the ball cannot be used: ${firstSentence(unusable.sentence)}`;
	const swapped = solution?.passes ? openFindings(solution).find(({ kind }) => kind === 'sides_swapped') : undefined;
	return swapped ? `left and right seem to be swapped: ${swapped.sentence}` : null;
}
