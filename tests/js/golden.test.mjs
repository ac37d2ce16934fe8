/** The browser's numbers are the server's: tests/js/golden.json is made by `python -m tests.js.golden`. */

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { describe, it } from 'node:test';

import { exactBox, optimizedBall } from '../../static/geometry/ball.js';
import { cameraFromJson, project, undistortPixel } from '../../static/geometry/camera.js';
import { previewBall } from '../../static/geometry/preview.js';
import { parallaxDegrees, triangulate } from '../../static/geometry/triangulation.js';
import { close } from './scene.mjs';

const golden = JSON.parse(readFileSync(new URL('golden.json', import.meta.url), 'utf8'));
const cameras = Object.fromEntries(
	Object.entries(golden.cameras).map(([name, json]) => [name, cameraFromJson(json)]),
);
const PIXELS = 1e-6;
const METRES = 1e-6;
const PHI = golden.ball_diameter_m;
const xy = (pixel) => pixel && [pixel.x, pixel.y];

describe('projection', () => {
	for (const { camera, points, pixels, ideal_pixels: ideal } of golden.projections) {
		it(`through the ${camera} camera is the server's, unseen points included`, () => {
			assert.ok(pixels.filter(Boolean).length > 5, 'too few points are seen to prove anything');
			points.forEach((point, i) => {
				const found = xy(project(cameras[camera], point));
				if (pixels[i] === null) assert.equal(found, null, `point ${i} is not seen`);
				else close(found, pixels[i], PIXELS);
			});
		});

		it(`through the ${camera} camera is undistorted as the server does it`, () => {
			pixels.forEach((pixel, i) => {
				if (!pixel) return;
				close(xy(undistortPixel(cameras[camera], { x: pixel[0], y: pixel[1] })), ideal[i], PIXELS);
			});
		});
	}
});

describe('the linear DLT', () => {
	it('meets in the same point for every pair of cameras', () => {
		const pairs = new Set(golden.triangulations.map((one) => one.cameras.join(' ')));
		assert.ok(pairs.size >= 6, 'too few pairs of cameras see a ball together');
		for (const { cameras: names, pixels, point, reprojected, parallax_degrees: angle } of golden.triangulations) {
			const [a, b] = names.map((name) => cameras[name]);
			const [first, second] = pixels.map(([x, y]) => ({ x, y }));
			const found = triangulate(a, first, b, second);
			close(found, point, METRES);
			close(xy(project(a, found)), reprojected[0], PIXELS);
			close(xy(project(b, found)), reprojected[1], PIXELS);
			close([parallaxDegrees(a, b, found)], [angle], 1e-6);
		}
	});
});

describe('boxes', () => {
	it('optimised and exact ones are the server\'s', () => {
		assert.ok(golden.boxes.length > 20);
		for (const { camera, point, center, diameter, distance, exact_box: exact } of golden.boxes) {
			const found = optimizedBall(cameras[camera], { x: center[0], y: center[1] }, point, PHI);
			close([found.diameter], [diameter], PIXELS);
			close([found.distance], [distance], METRES);
			close(exactBox(cameras[camera], point, PHI), exact, PIXELS);
		}
	});
});

describe('previewBall', () => {
	for (const [i, { policy, views, solution }] of golden.groups.entries()) {
		it(`gives the server's numbers of group ${i + 1} back`, () => {
			const blank = {
				...solution, pairs: [], ball: solution.ball && { ...solution.ball, point: [0, 0, 0] },
				views: solution.views.map((view) => ({ ...view, ball: null })),
			};
			const found = previewBall({ policy, views }, blank);
			close(found.ball.point, solution.ball.point, METRES);
			assert.deepEqual(found.ball.views, solution.ball.views);
			assert.deepEqual(found.pairs.map(({ valid }) => valid), solution.pairs.map(({ valid }) => valid));
			found.pairs.forEach((pair, k) => close(pair.errors_px, solution.pairs[k].errors_px, PIXELS));
			found.views.forEach(({ ball }, k) => {
				const said = solution.views[k].ball;
				if (!said) return;
				close(ball.reprojected, said.reprojected, PIXELS);
				close(ball.optimized_box, said.optimized_box, PIXELS);
				close(ball.exact_box, said.exact_box, PIXELS);
				close([ball.error_px, ball.size_ratio], [said.error_px, said.size_ratio], PIXELS);
			});
		});
	}
});
