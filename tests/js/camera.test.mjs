import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import {
	cameraFromJson, pixelToIdeal, project, projectionMatrix, rayThrough, rotationFromPanTiltRoll,
} from '../../static/geometry/camera.js';
import { distort, foldRadius, undistort } from '../../static/geometry/distortion.js';
import { close, mainCamera } from './scene.mjs';

describe('rotationFromPanTiltRoll', () => {
	it('looks towards -y with pan 0 and tilt 90 degrees', () => {
		const R = rotationFromPanTiltRoll(0, Math.PI / 2, 0);
		close(R[2], [0, -1, 0]);
	});

	it('looks straight down with tilt 0', () => {
		close(rotationFromPanTiltRoll(0, 0, 0)[2], [0, 0, 1]);
	});

	it('turns to the right goal with a positive pan', () => {
		const [x, y] = rotationFromPanTiltRoll(0.3, Math.PI / 2, 0)[2];
		close([x, y], [Math.sin(0.3), -Math.cos(0.3)]);
	});
});

describe('project', () => {
	it('puts a point on the axis into the principal point', () => {
		const camera = cameraFromJson({ ...mainCamera, tilt_degrees: 90, pan_degrees: 0 });
		close(Object.values(project(camera, [0, 0, -12])), [479.5, 269.5]);
	});

	it('gives the pixel that a hand calculation gives', () => {
		// Level camera at (0, 60, -12) that looks towards -y: depth 60, 6 m to the right, 3 m down.
		const camera = cameraFromJson({ ...mainCamera, tilt_degrees: 90, pan_degrees: 0 });
		close(Object.values(project(camera, [6, 0, -9])), [479.5 + 150, 269.5 + 75]);
	});

	it('sees nothing behind the camera', () => {
		const camera = cameraFromJson({ ...mainCamera, tilt_degrees: 90, pan_degrees: 0 });
		assert.equal(project(camera, [0, 70, -12]), null);
	});

	it('equals the projection matrix without distortion', () => {
		const camera = cameraFromJson(mainCamera);
		const point = [12.5, -7.25, -1.5];
		const [x, y, w] = projectionMatrix(camera).map((row) => row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3]);
		close(Object.values(project(camera, point)), [x / w, y / w]);
	});
});

describe('rayThrough', () => {
	it('goes through the point whose pixel it is, with distortion too', () => {
		const camera = cameraFromJson({ ...mainCamera, radial_distortion: [0.12, -0.03, 0, 0, 0, 0] });
		const point = [20, 5, -2];
		const ray = rayThrough(camera, project(camera, point));
		const t = (point[1] - camera.C[1]) / ray[1];
		close([camera.C[0] + t * ray[0], camera.C[2] + t * ray[2]], [20, -2], 1e-9);
	});
});

describe('undistort', () => {
	const lens = [0.1, 0.02, 0.001, -0.002, 0.003, 0.01, 0.002, 0.001, 0.0005, 0, -0.0004, 0];

	it('is the inverse of distort', () => {
		const ideal = [0.31, -0.22];
		close(undistort(distort(ideal, lens), lens), ideal, 1e-12);
	});

	it('has no answer where the lens never puts a point', () => {
		assert.equal(undistort([0.9, 0], [-0.4, ...Array(11).fill(0)]), null);
	});

	it('finds what is seen beyond the fold and lies within it', () => {
		const lens = [0.444, -0.121, 0, 0, 0.001, ...Array(7).fill(0)];
		const fold = foldRadius(lens);
		const ideal = [0.95 * fold, 0];
		assert.ok(distort(ideal, lens)[0] > fold);
		close(undistort(distort(ideal, lens), lens), ideal, 1e-6);
	});

	it('leaves a pixel alone without distortion', () => {
		close(pixelToIdeal(cameraFromJson(mainCamera), { x: 479.5 + 1500, y: 269.5 }), [1, 0]);
	});
});

describe('foldRadius', () => {
	it('is where r + k1 r^3 stops growing', () => {
		close([foldRadius([-0.3, ...Array(11).fill(0)])], [Math.sqrt(1 / 0.9)]);
	});

	it('finds the same place by search as in closed form', () => {
		close([foldRadius([-0.3, 1e-300, ...Array(10).fill(0)])], [Math.sqrt(1 / 0.9)], 1e-9);
	});

	it('is infinite for a lens that only stretches', () => {
		assert.equal(foldRadius([0.3, ...Array(11).fill(0)]), Infinity);
	});

	it('ends where the denominator of a rational model is zero, as on the server', () => {
		for (const [k1, k2, k3, k4, k5, k6, radius] of [
			[0.1, 0.02, 0.01, -0.3, 0, 0, 1.8257418583505538],
			[0, 0, 0, -0.25, 0, 0, 2],
			[-0.2, 0.05, -0.01, 0.1, -0.02, 0.001, 1.5324175515362053],
			[0.3, -0.1, 0.02, 0.25, -0.05, -0.01, 2.1762980140265027],
		]) {
			const lens = [k1, k2, 0, 0, k3, k4, k5, k6, 0, 0, 0, 0];
			close([foldRadius(lens)], [radius], 1e-9);
		}
	});
});
