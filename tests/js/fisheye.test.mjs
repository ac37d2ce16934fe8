/** Wide lenses in the browser: up to the edge of what they show, and no further. */

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { describe, it } from 'node:test';

import { exactBox } from '../../static/geometry/ball.js';
import { cameraFromJson, idealToPixel, pixelToIdeal, project, rayThrough } from '../../static/geometry/camera.js';
import { epipolarSegment } from '../../static/geometry/epipolar.js';
import { bend, bendJacobian, profileOf, unbend } from '../../static/geometry/fisheye.js';
import { cameraNumbers } from '../../static/views/calibration/camera_numbers.js';
import { seenAt } from '../../static/views/scene3d/values.js';
import { close } from './scene.mjs';

const golden = JSON.parse(readFileSync(new URL('golden.json', import.meta.url), 'utf8'));
const FOLDING = [-0.12, 0.01, -0.02, 0];

for (const name of ['fisheye', 'panorama']) {
	const json = golden.cameras[name];
	const profile = profileOf(json.lens, json.lens_coefficients);

	describe(`the ${name} lens`, () => {
		it('brings every ray up to its edge back', () => {
			for (let angle = 0; angle < 0.999 * profile.widest; angle += 0.01) {
				const ideal = [Math.tan(angle) * 0.6, Math.tan(angle) * -0.8];
				const [x, y] = unbend(bend(ideal, profile), profile);
				assert.ok(Math.abs(Math.atan(Math.hypot(x, y)) - angle) < 1e-9, `${angle}`);
			}
		});

		it('has the slope that differences have', () => {
			for (const [x, y] of [[0.3, -0.2], [-1.5, 0.7], [2.5, 3]]) {
				const ahead = [bend([x + 1e-6, y], profile), bend([x, y + 1e-6], profile)];
				const behind = [bend([x - 1e-6, y], profile), bend([x, y - 1e-6], profile)];
				const [uu, uv, vu, vv] = bendJacobian([x, y], profile);
				const slope = (i, axis) => (ahead[i][axis] - behind[i][axis]) / 2e-6;
				close([uu, uv, vu, vv], [slope(0, 0), slope(1, 0), slope(0, 1), slope(1, 1)], 1e-8);
			}
		});
	});
}

describe('a polynomial with a constant', () => {
	it('is taken to the axis in a straight line within ten times its share', () => {
		const terms = golden.cameras.panorama.lens_coefficients;
		const inner = (10 * Math.abs(terms[0])) / terms[1];
		const radius = terms.reduce((total, term, power) => total + term * inner ** power, 0);
		close(bend([Math.tan(inner / 2), 0], profileOf('arctan_polynomial', terms)), [radius / 2, 0], 1e-15);
		close(unbend([0, radius / 2], profileOf('arctan_polynomial', terms)), [0, Math.tan(inner / 2)], 1e-15);
	});
});

describe('the edge of a wide lens', () => {
	const camera = cameraFromJson({ ...golden.cameras.fisheye, lens_coefficients: FOLDING });
	const { wide, focal: [fx], principal: [x, y] } = camera;

	it('lets no folded point back into the picture', () => {
		assert.ok(wide.widest < 1.5);
		assert.equal(idealToPixel(camera, [Math.tan(wide.widest + 0.1), 0]), null);
		assert.ok(idealToPixel(camera, [Math.tan(wide.widest - 0.01), 0]));
	});

	it('gives no ray to a pixel beyond it', () => {
		assert.equal(rayThrough(camera, { x: x + 1.01 * wide.edge * fx, y }), null);
		assert.ok(rayThrough(camera, { x: x + 0.99 * wide.edge * fx, y }));
	});

	it('cuts a ball, which has no box then', () => {
		const at = (angle) => seenAt(camera, idealToPixel(camera, [Math.tan(angle), 0]), 14);
		assert.ok(exactBox(camera, at(wide.widest - 0.05), 0.22));
		assert.equal(exactBox(camera, at(wide.widest - 0.004), 0.22), null);
	});

	it('bounds what the 3D view hangs up of its picture', () => {
		const corner = seenAt(camera, { x: -4000, y: -4000 }, 9);
		assert.ok(corner.every(Number.isFinite));
		assert.ok(Math.abs(Math.hypot(...corner.map((value, i) => value - camera.C[i])) - 9) < 1e-9);
	});
});

describe('what is drawn through a wide lens', () => {
	const wide = cameraFromJson(golden.cameras.fisheye);
	const plain = cameraFromJson(golden.cameras.pinhole);

	it('bends: an epipolar line is a curve on which every place of the ray lies', () => {
		const ray = rayThrough(plain, { x: 700, y: 300 });
		const curve = epipolarSegment(plain, { x: 700, y: 300 }, wide);
		assert.ok(curve.length > 20);
		const [first, last] = [curve[0], curve.at(-1)];
		const length = Math.hypot(last.x - first.x, last.y - first.y);
		const off = curve.map((p) => Math.abs((p.x - first.x) * (last.y - first.y) - (p.y - first.y) * (last.x - first.x)) / length);
		assert.ok(Math.max(...off) > 5, 'it is no straight line');
		const place = project(wide, plain.C.map((value, i) => value + 55 * ray[i]));
		const near = Math.min(...curve.map((p) => Math.hypot(p.x - place.x, p.y - place.y)));
		assert.ok(near < 15);
	});

	it('is seen at the pixel that shows it', () => {
		const again = project(wide, seenAt(wide, { x: 30, y: 600 }, 70));
		close([again.x, again.y], [30, 600], 1e-6);
	});
});

describe('cameraNumbers', () => {
	it('name the terms of a wide lens, and its true field of view', () => {
		const camera = golden.cameras.fisheye;
		const rows = cameraNumbers({ camera }, { width: 1280, height: 720 });
		assert.deepEqual(rows.slice(-4).map(({ label }) => label), ['Fisheye k1', 'Fisheye k2', 'Fisheye k3', 'Fisheye k4']);
		const field = rows.find(({ name }) => name === 'field').value;
		const [x] = pixelToIdeal(cameraFromJson({ ...camera, skew: 0 }), { x: camera.principal_point[0] + 640, y: camera.principal_point[1] });
		assert.ok(Math.abs(field - (360 / Math.PI) * Math.atan(x)) < 1e-9);
		assert.ok(field > 120, 'a pinhole of that focal length has 113 degrees');
	});
});
