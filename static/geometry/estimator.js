// @ts-check
/** The solution measured with the most likely point in place of the mean of pairs. */

import { fitBall, seenBalls } from './preview.js';

/** @import {Ball3DJson, GroupDocument, SolutionJson} from '../api/types.js' */

/**
 * The same solution with its ball, and every view's fit, taken from the most likely point.
 *
 * Gates, pairs and exports stay with the paper's estimator: only what is looked at changes.
 *
 * @param {GroupDocument} group @param {SolutionJson} solution
 * @returns {SolutionJson} the solution itself when it has no such point, or no valid pair
 */
export function withBestBall(group, solution) {
	const best = solution.best_ball;
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
