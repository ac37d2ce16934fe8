import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { cameraFromJson, project } from '../../static/geometry/camera.js';
import { smallestSingularVector } from '../../static/geometry/matrix.js';
import {
	baseline, parallaxDegrees, reprojectionError, triangulate,
} from '../../static/geometry/triangulation.js';
import { close, goalCamera, mainCamera } from './scene.mjs';

describe('smallestSingularVector', () => {
	it('is the null space of a matrix that has one', () => {
		const x = smallestSingularVector([[1, 0, 0], [0, 1, -1], [1, 1, -1]]);
		close(x.map((value) => Math.abs(value)), [0, Math.SQRT1_2, Math.SQRT1_2], 1e-14);
	});

	it('takes the shortest axis of a diagonal matrix', () => {
		close(smallestSingularVector([[3, 0], [0, 0.5]]).map(Math.abs), [0, 1]);
	});
});

describe('triangulate', () => {
	const a = cameraFromJson(mainCamera);
	const b = cameraFromJson(goalCamera);
	const point = [38.2, -6.4, -1.32];

	it('returns the point whose images it is given', () => {
		close(triangulate(a, project(a, point), b, project(b, point)), point, 1e-9);
	});

	it('takes the distortion of both lenses out', () => {
		const bent = cameraFromJson({ ...goalCamera, radial_distortion: [0.08, 0, 0, 0, 0, 0] });
		close(triangulate(a, project(a, point), bent, project(bent, point)), point, 1e-8);
	});

	it('meets both rays within half a pixel when one image is a pixel off', () => {
		const pixel = project(a, point);
		const near = triangulate(a, { x: pixel.x + 1, y: pixel.y }, b, project(b, point));
		assert.ok(Math.hypot(...near.map((value, i) => value - point[i])) < 0.1);
		assert.ok(reprojectionError(b, near, project(b, point)) < 1);
	});
});

describe('triangulate with parallel rays', () => {
	const aside = (metres) => cameraFromJson({ ...mainCamera, position_meters: [metres, 0, 0] });
	const straight = { x: mainCamera.principal_point[0], y: mainCamera.principal_point[1] };

	it('has no point', () => {
		assert.equal(triangulate(aside(0), straight, aside(1), straight), null);
	});

	it('has none either beyond what the server calls a place', () => {
		const nearly = { x: straight.x + 1e-10, y: straight.y };
		assert.equal(triangulate(aside(0), straight, aside(1), nearly), null);
	});
});

describe('parallaxDegrees', () => {
	const at = (x, y) => cameraFromJson({ ...mainCamera, position_meters: [x, y, 0] });

	it('is a right angle between rays along x and y', () => {
		close([parallaxDegrees(at(0, 0), at(2, 2), [2, 0, 0])], [90]);
	});

	it('keeps its digits for cameras a millimetre apart', () => {
		const angle = parallaxDegrees(at(0, 0), at(0, 0.001), [100, 0, 0]);
		close([angle], [(1e-5 * 180) / Math.PI], 1e-13);
	});
});

describe('baseline', () => {
	it('is the distance of the two cameras', () => {
		close([baseline(cameraFromJson(mainCamera), cameraFromJson(goalCamera))], [Math.hypot(75, 58, 6)]);
	});
});
