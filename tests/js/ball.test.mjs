import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import {
	ballOutline, exactBox, optimizedBall, squareBox,
} from '../../static/geometry/ball.js';
import { cameraFromJson, pixelToIdeal, project, rayThrough } from '../../static/geometry/camera.js';
import { close, mainCamera } from './scene.mjs';

const PHI = 0.226;
const level = cameraFromJson({ ...mainCamera, pan_degrees: 0, tilt_degrees: 90 });

/** Where a ball is that looks `diameter` pixels wide at `center`: the oracle of what follows. */
function monocularBall(camera, center, diameter, phi) {
	const ray = rayThrough(camera, center);
	const upper = pixelToIdeal(camera, { x: center.x, y: center.y - diameter / 2 });
	const lower = pixelToIdeal(camera, { x: center.x, y: center.y + diameter / 2 });
	const scale = phi / Math.hypot(lower[0] - upper[0], lower[1] - upper[1]);
	return camera.C.map((start, axis) => start + scale * ray[axis]);
}

describe('optimizedBall', () => {
	it('gives the size of the ball at the depth of the point', () => {
		const found = optimizedBall(level, { x: 479.5, y: 269.5 }, [0, 0, -12], PHI);
		close([found.diameter, found.distance], [5.65, 0], 1e-9);
	});

	it('is where the monocular ball comes closest to the point', () => {
		const camera = cameraFromJson(mainCamera);
		const point = [10, 3, -1];
		const center = project(camera, [10.2, 3, -1.1]);
		const { diameter, distance } = optimizedBall(camera, center, point, PHI);
		const apart = (d) => Math.hypot(...monocularBall(camera, center, d, PHI).map((v, i) => v - point[i]));
		close([apart(diameter)], [distance], 1e-6);
		assert.ok(apart(diameter * 1.001) > distance && apart(diameter * 0.999) > distance);
	});

	it('has no box for a point behind the camera', () => {
		assert.equal(optimizedBall(level, { x: 479.5, y: 269.5 }, [0, 80, -12], PHI), null);
	});
});

describe('exactBox', () => {
	it('is a square on the axis, a little larger than the pinhole says', () => {
		const [x, y, width, height] = exactBox(level, [0, 0, -12], PHI);
		const expected = (2 * 1500 * 0.113) / Math.sqrt(60 * 60 - 0.113 * 0.113);
		close([width, height, x + width / 2, y + height / 2], [expected, expected, 479.5, 269.5], 1e-9);
	});

	it('bounds the outline', () => {
		const camera = cameraFromJson(mainCamera);
		const [x, y, width, height] = exactBox(camera, [25, 20, -3], PHI);
		const outline = ballOutline(camera, [25, 20, -3], PHI, 4000);
		close(
			[Math.min(...outline.map((p) => p.x)), Math.max(...outline.map((p) => p.x)),
				Math.min(...outline.map((p) => p.y)), Math.max(...outline.map((p) => p.y))],
			[x, x + width, y, y + height], 1e-5,
		);
	});

	it('does not exist for a camera inside the ball', () => {
		assert.equal(exactBox(level, [0, 60, -12], PHI), null);
	});
});

describe('squareBox', () => {
	it('has the centre that it was given', () => {
		assert.deepEqual(squareBox({ x: 10, y: 20 }, 4), [8, 18, 4, 4]);
	});
});
