import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { cameraFromJson, project } from '../../static/geometry/camera.js';
import { ellipsoidOf, symmetricEigen } from '../../static/geometry/ellipsoid.js';
import { dot } from '../../static/geometry/matrix.js';
import { fit, toScreen } from '../../static/geometry/viewport.js';
import {
	approached, axesOf, between, cameraProjection, carried, eyeOf, freeProjection, presetOrbit, shifted, toWorld, turned,
} from '../../static/views/scene3d/standpoints.js';
import { withTrackNames } from '../../static/views/scene3d/track_values.js';
import { sceneOf, seenAt } from '../../static/views/scene3d/values.js';

const CAMERA = {
	pan_degrees: 12, tilt_degrees: 78, roll_degrees: 1.5, x_focal_length: 2100, y_focal_length: 2080,
	principal_point: [655, 340], position_meters: [3, 60, -14], skew: 4,
};
const IMAGE = { width: 1280, height: 720 };

/** Place in a panel of a point of the pitch, through the library's matrices. */
function rendered(camera, point, rows, panel) {
	const offset = toWorld(point).map((value, i) => value - toWorld(camera.C)[i]);
	const seen = [...axesOf(camera).map((axis) => dot(axis, offset)), 1];
	const clip = [0, 1, 2, 3].map((row) => dot(rows.slice(4 * row, 4 * row + 4), seen));
	return { x: ((clip[0] / clip[3] + 1) / 2) * panel.width, y: ((1 - clip[1] / clip[3]) / 2) * panel.height, w: clip[3] };
}

describe('cameraProjection', () => {
	for (const panel of [{ width: 640, height: 360 }, { width: 900, height: 400 }, { width: 300, height: 500 }]) {
		it(`puts a point where the image shows it, panel ${panel.width} x ${panel.height}`, () => {
			const camera = cameraFromJson(CAMERA);
			const rows = cameraProjection(camera, IMAGE, panel);
			for (const point of [[0, 0, 0], [10, -20, -2.44], [-5, 20, 0], [12, 30, -8]]) {
				const expected = toScreen(fit(IMAGE, panel), project(camera, point));
				const found = rendered(camera, point, rows, panel);
				assert.ok(Math.hypot(found.x - expected.x, found.y - expected.y) < 1e-9, `${point}`);
			}
		});
	}

	it('gives what lies behind the camera a negative depth', () => {
		const camera = cameraFromJson(CAMERA);
		assert.ok(rendered(camera, [3, 90, -14], cameraProjection(camera, IMAGE, IMAGE), IMAGE).w < 0);
	});
});

describe('seenAt', () => {
	it('is the inverse of the projection, lens included', () => {
		const camera = cameraFromJson({ ...CAMERA, radial_distortion: [0.12, 0.01, 0, 0, 0, 0] });
		const pixel = { x: 200, y: 600 };
		const again = project(camera, seenAt(camera, pixel, 70));
		assert.ok(Math.hypot(again.x - pixel.x, again.y - pixel.y) < 1e-6);
	});
});

/** Where an orbit shows a point of the pitch: -1 to 1 across and up the panel. */
function seenFrom(orbit, aspect, point) {
	const [sin, cos] = [Math.sin(orbit.azimuth), Math.cos(orbit.azimuth)];
	const [rise, flat] = [Math.sin(orbit.elevation), Math.cos(orbit.elevation)];
	const axes = [[cos, 0, -sin], [-rise * sin, flat, -rise * cos], [flat * sin, rise, flat * cos]];
	const offset = toWorld(point).map((value, i) => value - eyeOf(orbit)[i]);
	const [right, up, back] = axes.map((axis) => dot(axis, offset));
	const rows = freeProjection(aspect);
	return { x: (rows[0] * right) / -back, y: (rows[5] * up) / -back };
}

describe('orbits', () => {
	const scene = { pitch: { length: 105, width: 68 }, stands: [], pairs: [], ball: null, best: null, diameter: 0.22 };

	it('moves with the ball and stays turned', () => {
		const before = { target: /** @type {[number, number, number]} */ ([1, 0, 2]), distance: 5, azimuth: 0.35, elevation: 0.3 };
		const after = { ...before, target: /** @type {[number, number, number]} */ ([10, 1, -20]), distance: 9 };
		const orbit = carried(approached(turned(before, 1, 0.2), 2), before, after);
		assert.deepEqual(orbit, { target: [10, 1, -20], distance: 10, azimuth: 1.35, elevation: 0.5 });
	});

	it('stand above the grass on the side of the near side line', () => {
		const eye = eyeOf(presetOrbit('whole', scene, 1.6));
		assert.ok(eye[1] > 10 && eye[2] > 0);
		assert.deepEqual(toWorld([1, 2, -3]), [1, 3, 2]);
	});

	it('show the whole pitch from above at any shape of panel', () => {
		for (const aspect of [0.5, 1, 1.6, 3]) {
			const orbit = presetOrbit('top', scene, aspect);
			const rows = freeProjection(aspect);
			const [halfWidth, halfHeight] = [orbit.distance / rows[0], orbit.distance / rows[5]];
			assert.ok(halfWidth > 52.5 && halfHeight > 34, `${aspect}`);
		}
	});

	it('show the whole pitch and every camera at any shape of panel', () => {
		const at = (position) => {
			const camera = cameraFromJson({ ...CAMERA, position_meters: position });
			const corners = [[0, 0], [1280, 0], [1280, 720], [0, 720]].map(([x, y]) => seenAt(camera, { x, y }, 9));
			return { camera, corners };
		};
		const arrangements = [
			[[0, 60, -14]], [[-34, 88, -20], [-34, -88, -20], [2, 90, -21], [-2, -90, -21], [34, 88, -20], [34, -88, -20]],
			[[-120, 5, -3], [110, -70, -30], [0, 200, -45]],
		];
		for (const positions of arrangements) {
			const stands = positions.map(at);
			for (const aspect of [0.5, 1, 1.6, 3]) {
				const orbit = presetOrbit('whole', { ...scene, stands }, aspect);
				const shown = [...positions, ...stands.flatMap(({ corners }) => corners), [-52.5, -34, 0], [52.5, 34, 0], [-52.5, 34, 0]];
				for (const point of shown) {
					const { x, y } = seenFrom(orbit, aspect, point);
					assert.ok(Math.abs(x) < 0.95 && y > -0.95 && y < 0.8, `${aspect}: ${point} at ${x}, ${y}`);
				}
			}
		}
	});

	it('come close when all is on the pitch', () => {
		assert.ok(presetOrbit('whole', scene, 1.6).distance < 180);
	});

	it('look at the goal that the ball is near', () => {
		const ball = { point: [-40, 0, -1], height: 1, sigma: 0.1, ellipsoid: null };
		assert.ok(presetOrbit('goal', { ...scene, ball }, 1.6).target[0] < 0);
		assert.ok(presetOrbit('goal', scene, 1.6).target[0] > 0);
	});

	it('come as close to the ball as its uncertainty allows', () => {
		const ball = (radius) => ({ point: [0, 0, -1], height: 1, sigma: 1, ellipsoid: { axes: [], radii: [radius] } });
		const near = presetOrbit('ball', { ...scene, ball: ball(0.1) }, 1.6);
		const far = presetOrbit('ball', { ...scene, ball: ball(6) }, 1.6);
		assert.ok(near.distance < far.distance);
		assert.deepEqual(near.target, [0, 1, 0]);
	});

	it('never turn below the grass or over the top', () => {
		const orbit = presetOrbit('whole', scene, 1.6);
		assert.ok(turned(orbit, 0, -9).elevation > 0);
		assert.ok(turned(orbit, 0, 9).elevation < Math.PI / 2);
		assert.ok(eyeOf(turned(orbit, 1, -9))[1] > 0);
	});

	it('meet their ends in between, the short way round', () => {
		const a = { target: [0, 0, 0], distance: 10, azimuth: 3, elevation: 0.2 };
		const b = { target: [4, 2, 0], distance: 40, azimuth: -3, elevation: 0.6 };
		assert.deepEqual(between(a, b, 0), a);
		const half = between(a, b, 0.5);
		assert.ok(Math.abs(half.azimuth - Math.PI) < 1e-9 && Math.abs(half.distance - 20) < 1e-9);
	});

	it('shift the scene with the pointer', () => {
		const orbit = { target: [0, 0, 0], distance: 10, azimuth: 0, elevation: 0.5 };
		assert.ok(shifted(orbit, 0.1, 0).target[0] < 0);
		assert.ok(shifted(orbit, 0, 0.1).target[1] > 0);
		assert.equal(approached(orbit, 0.5).distance, 5);
	});
});

describe('symmetricEigen', () => {
	it('takes a matrix apart that can be put together again', () => {
		const A = [[4, 1, -2], [1, 3, 0.5], [-2, 0.5, 6]];
		const { values, vectors } = symmetricEigen(A);
		for (let i = 0; i < 3; i++) {
			for (let j = 0; j < 3; j++) {
				const back = values.reduce((sum, value, k) => sum + value * vectors[k][i] * vectors[k][j], 0);
				assert.ok(Math.abs(back - A[i][j]) < 1e-12);
			}
		}
	});
});

describe('ellipsoidOf', () => {
	it('has half axes of k standard deviations, the longest first', () => {
		const { axes, radii } = ellipsoidOf([0.01, 0, 0, 0, 0.25, 0, 0, 0, 0.04], 2);
		[1, 0.4, 0.2].forEach((radius, i) => assert.ok(Math.abs(radii[i] - radius) < 1e-12));
		assert.ok(Math.abs(Math.abs(axes[0][1]) - 1) < 1e-12);
	});

	it('has axes that make a right-handed frame', () => {
		const { axes: [a, b, c] } = ellipsoidOf([4, 1, -2, 1, 3, 0.5, -2, 0.5, 6], 1);
		const turned = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
		assert.ok(dot(turned, c) > 0.999999);
	});

	it('is none where a number is missing or the matrix is no covariance', () => {
		assert.equal(ellipsoidOf([null, 0, 0, 0, 1, 0, 0, 0, 1], 2), null);
		assert.equal(ellipsoidOf([], 2), null);
		assert.equal(ellipsoidOf([-1, 0, 0, 0, 1, 0, 0, 0, 1], 2), null);
	});
});

describe('sceneOf', () => {
	const view = {
		key: 'a', letter: 'A', label: 'Main', ...IMAGE, image: null, included: true, lines: {},
		balls: [{ box: null, point: [640, 300], occluded: false, out_of_view: false }],
	};
	const group = { pitch: { length: 105, width: 68 }, policy: { ball_diameter_m: 0.22 }, views: [view] };
	const solved = { view: 'a', included: false, calibration: { camera: CAMERA } };

	it('lets a ray without a 3D ball end on the grass', () => {
		const [stand] = sceneOf(group, { views: [solved], pairs: [], ball: null }).stands;
		assert.ok(Math.abs(stand.ray[2]) < 1e-9);
		assert.equal(stand.used, false);
	});

	it('lets a ray end beside the 3D ball', () => {
		const ball = { point: [5, -10, -6], height_m: 6, sigma_m: 0.1, covariance: [] };
		const [stand] = sceneOf(group, { views: [solved], pairs: [], ball }).stands;
		const along = stand.ray.map((value, i) => value - CAMERA.position_meters[i]);
		const across = stand.ray.map((value, i) => value - ball.point[i]);
		assert.ok(Math.abs(dot(along, across)) < 1e-6);
	});

	it('shows the mean of pairs as such where the most likely point is exported', () => {
		const [mean, best] = [[5, -10, -6], [5.2, -10, -6]].map((point) => ({ point, height_m: 6, sigma_m: 0.1, covariance: [] }));
		const scene = sceneOf(group, { views: [solved], pairs: [], ball: best, mean_ball: mean, best_ball: best });
		assert.deepEqual([scene.ball.point, scene.best.point], [mean.point, best.point]);
	});

	it('is a bare pitch while nothing is solved', () => {
		const scene = sceneOf(group, null);
		assert.deepEqual([scene.stands, scene.pairs, scene.ball, scene.best], [[], [], null, null]);
	});
});

describe('withTrackNames', () => {
	it('calls cameras by their keys where the track does', () => {
		const stands = [{ key: 'cam1', label: 'Camera 1' }, { key: 'cam2', label: 'Camera 2' }];
		assert.deepEqual(withTrackNames(stands, { views: [[], ['cam2']] }).map(({ label }) => label), ['cam1', 'cam2']);
		assert.equal(withTrackNames(stands, { views: [['main']] }), stands);
	});
});
