import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { cameraFromJson, project } from '../../static/geometry/camera.js';
import { ballTold } from '../../static/geometry/estimator.js';
import { previewBall } from '../../static/geometry/preview.js';
import { close, goalCamera, mainCamera } from './scene.mjs';

const point = [30, -4, -1.5];
const policy = { tau_percent: 1, min_baseline_m: 1, ball_diameter_m: 0.226 };

function viewOf(key, json, shift = 0) {
	const { x, y } = project(cameraFromJson(json), point);
	return {
		key, width: 960, height: 540, included: true, lines: {},
		balls: [{ box: [x + shift - 5, y - 5, 10, 10], point: null, occluded: false, out_of_view: false }],
	};
}

function solved(key, camera, failed = null) {
	return { view: key, included: true, failed, calibration: { camera, markings: [] }, ball: null };
}

const solution = {
	ball: { sigma_m: 0.2, covariance: [] }, pairs: [], gates: [], findings: [],
	views: [solved('a', mainCamera), solved('b', goalCamera)],
};

describe('previewBall', () => {
	it('finds the point that both views show', () => {
		const group = { policy, views: [viewOf('a', mainCamera), viewOf('b', goalCamera)] };
		const next = previewBall(group, solution);
		close(next.ball.point, point, 1e-8);
		assert.deepEqual(next.ball.views, ['a', 'b']);
		assert.ok(next.views.every(({ ball }) => ball.error_px < 1e-6));
		close([next.ball.height_m], [1.5], 1e-8);
	});

	it('lets a ball confirm nothing that was put where the others see it', () => {
		const put = viewOf('a', mainCamera);
		const group = { policy, views: [{ ...put, balls: [{ ...put.balls[0], inferred: true }] }, viewOf('b', goalCamera)] };
		assert.deepEqual(previewBall(group, solution).pairs, []);
	});

	it('draws no box in a view that no valid pair has', () => {
		const third = { ...goalCamera, position_meters: [70, 12, -6] };
		const views = [viewOf('a', mainCamera), viewOf('b', goalCamera), viewOf('c', third)];
		const fell = { ...solution, views: [...solution.views, solved('c', third, 'jac')] };
		const next = previewBall({ policy, views }, fell);
		assert.deepEqual(next.ball.views, ['a', 'b']);
		assert.deepEqual(next.views.map(({ ball }) => ball.optimized_box !== null), [true, true, false]);
		assert.ok(Number.isFinite(next.views[2].ball.error_px));
	});

	it('has no ball when the views do not meet', () => {
		const group = { policy, views: [viewOf('a', mainCamera, 200), viewOf('b', goalCamera)] };
		const next = previewBall(group, solution);
		assert.equal(next.ball, null);
		assert.equal(next.pairs[0].failed, 'reprojection');
	});

	for (const gate of ['calibratable', 'jac', 'agreement']) {
		it(`does not let a view count that the gate ${gate} dropped`, () => {
			const group = { policy, views: [viewOf('a', mainCamera), viewOf('b', goalCamera)] };
			const dropped = { ...solution, views: [solved('a', mainCamera, gate), solution.views[1]] };
			assert.equal(previewBall(group, dropped).pairs[0].failed, gate);
		});
	}

	it('lets a view count that is used again', () => {
		const group = { policy, views: [viewOf('a', mainCamera), viewOf('b', goalCamera)] };
		const again = { ...solution, views: [solved('a', mainCamera, 'excluded'), solution.views[1]] };
		assert.equal(previewBall(group, again).pairs[0].failed, null);
	});

	it('leaves out a view that a person left out', () => {
		const group = { policy, views: [{ ...viewOf('a', mainCamera), included: false }, viewOf('b', goalCamera)] };
		assert.deepEqual(previewBall(group, solution).pairs, []);
	});

	it('does not pick one of several balls', () => {
		const a = viewOf('a', mainCamera);
		const group = { policy, views: [{ ...a, balls: [...a.balls, ...a.balls] }, viewOf('b', goalCamera)] };
		assert.deepEqual(previewBall(group, solution).pairs, []);
	});

	it('is the mean of pairs and says so, where the policy exports the most likely point', () => {
		const group = { policy, views: [viewOf('a', mainCamera), viewOf('b', goalCamera)] };
		const exported = { ...solution, point: 'best', mean_ball: { point: [0, 0, 0] } };
		const next = previewBall(group, exported);
		assert.equal(next.point, 'mean');
		assert.equal(next.mean_ball, null);
		assert.deepEqual(ballTold(next, 'exported', exported, true), { name: 'pair average', state: 'until saved' });
		assert.deepEqual(ballTold(exported, 'exported', exported, false), { name: 'most likely point', state: 'exported' });
	});

	it('stays what is exported where that is the mean of pairs', () => {
		const group = { policy, views: [viewOf('a', mainCamera), viewOf('b', goalCamera)] };
		const next = previewBall(group, solution);
		assert.deepEqual(ballTold(next, 'exported', solution, true), { name: 'pair average', state: 'exported' });
		assert.deepEqual(ballTold(next, 'other', solution, true), { name: 'pair average', state: 'until saved' });
	});
});
