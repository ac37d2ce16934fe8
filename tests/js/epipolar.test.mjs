import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { cameraFromJson, project } from '../../static/geometry/camera.js';
import { epipolarSegment, heightRange } from '../../static/geometry/epipolar.js';
import { nearestOn } from '../../static/geometry/polyline.js';
import { close, goalCamera, mainCamera } from './scene.mjs';

describe('heightRange', () => {
	it('ends where a falling ray meets the grass', () => {
		close(heightRange([0, 0, -10], [1, 0, 0.5]), [0.5, 20]);
	});

	it('ends thirty metres up for a rising ray', () => {
		close(heightRange([0, 0, -10], [1, 0, -0.5]), [0.5, 40]);
	});

	it('is empty for a camera above all heights that looks up', () => {
		assert.equal(heightRange([0, 0, -40], [1, 0, -0.1]), null);
	});

	it('is the whole ray when it is level', () => {
		close(heightRange([0, 0, -10], [1, 0, 0]), [0.5, 300]);
	});
});

describe('epipolarSegment', () => {
	it('passes through the image of the point that it comes from', () => {
		const a = cameraFromJson(mainCamera);
		const b = cameraFromJson(goalCamera);
		const point = [20, -3, -2];
		const segment = epipolarSegment(a, project(a, point), b);
		assert.ok(nearestOn(segment, project(b, point)).distance < 0.01);
	});

	it('is empty where the other camera looks away', () => {
		const a = cameraFromJson(mainCamera);
		const away = cameraFromJson({ ...mainCamera, pan_degrees: 180 });
		assert.deepEqual(epipolarSegment(a, { x: 480, y: 300 }, away), []);
	});
});
