// @ts-check
/** The solution measured with the other 3D ball than the one that is exported. */

import { fitBall, seenBalls } from './preview.js';

/** @import {Ball3DJson, GroupDocument, SolutionJson} from '../api/types.js' */

/**
 * The same solution with its ball, and every view's fit, taken from the other point: the most likely one where the
 * mean of pairs is exported, and the mean where the policy exports the most likely one.
 *
 * Gates, pairs and exports stay as they are: only what is looked at changes.
 *
 * @param {GroupDocument} group @param {SolutionJson} solution
 * @returns {SolutionJson} the solution itself when it has no other point, or no valid pair
 */
export function withOtherBall(group, solution) {
	const best = solution.mean_ball ?? solution.best_ball;
	if (!best || !solution.ball) return solution;
	const seen = seenBalls(group, solution);
	/** @type {Ball3DJson} */
	const ball = { ...best, parallax_degrees: solution.ball.parallax_degrees };
	return {
		...solution,
		ball,
		views: solution.views.map((view) => {
			const one = seen.find((candidate) => candidate.view.key === view.view);
			return { ...view, ball: one ? fitBall(one, best.point, group.policy.ball_diameter_m) : view.ball };
		}),
	};
}

/**
 * What people call the 3D ball that is looked at.
 *
 * @param {SolutionJson | null} solution @param {'exported' | 'other'} which
 */
export function ballName(solution, which) {
	return (solution?.point === 'best') !== (which === 'other') ? 'most likely point' : 'pair average';
}

/**
 * What stands beside the numbers of the 3D ball: its name, and whether it is what leaves.
 *
 * @param {SolutionJson} solution that is shown
 * @param {'exported' | 'other'} which
 * @param {SolutionJson | null} saved the server's
 * @param {boolean} live whether an edit is not saved yet: the other ball is not known then
 */
export function ballTold(solution, which, saved, live) {
	if (!live) return { name: ballName(solution, which), state: which === 'other' ? 'not exported' : 'exported' };
	const same = which === 'exported' && (solution.point === 'best') === (saved?.point === 'best');
	return { name: ballName(solution, 'exported'), state: same ? 'exported' : 'until saved' };
}
