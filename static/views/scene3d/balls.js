// @ts-check
/** The ball in space: pair points, their mean, the best estimate, how far off it may be. */

import {
	CircleGeometry, Color, Group, Matrix4, Mesh, MeshBasicMaterial, SphereGeometry, Vector3,
} from 'three';

import { mark } from './marks.js';
import { segments } from './pitch.js';
import { toWorld } from './standpoints.js';

/** @import {Ellipsoid} from '../../geometry/ellipsoid.js' */
/** @import {Palette} from './scene_colours.js' */
/** @import {SceneValues} from './values.js' */

const SHADOW = 0.35;
const MARK = 0.02;

/** @param {SceneValues} scene @param {Palette} palette @returns {Group} */
export function ballGroup(scene, palette) {
	const group = new Group();
	const halo = palette.shadow;
	for (const { point, valid } of scene.pairs) {
		group.add(mark(valid ? 'ring' : 'cross', point, {
			colour: valid ? palette.valid : palette.invalid, halo, size: 0.75 * MARK,
		}));
	}
	const main = scene.best ?? scene.ball;
	if (main) group.add(...standing(main.point, scene.diameter, palette));
	if (main?.ellipsoid) group.add(cloud(main.ellipsoid, main.point, palette));
	if (scene.ball) group.add(mark('disc', scene.ball.point, { colour: palette.ball, halo, size: MARK }));
	if (scene.best) group.add(mark('diamond', scene.best.point, { colour: palette.best, halo, size: 0.8 * MARK }));
	return group;
}

/**
 * The ball itself, its shadow on the ground and the stem between them.
 *
 * @param {readonly number[]} point @param {number} diameter @param {Palette} palette
 */
function standing(point, diameter, palette) {
	const [x, y] = point;
	const shadow = new Mesh(
		new CircleGeometry(SHADOW, 32),
		new MeshBasicMaterial({ color: new Color(palette.shadow), transparent: true, opacity: 0.6, depthWrite: false }),
	);
	shadow.rotation.x = -Math.PI / 2;
	shadow.position.set(...toWorld([x, y, -0.03]));
	shadow.renderOrder = 2;
	const ball = new Mesh(
		new SphereGeometry(diameter / 2, 24, 16), new MeshBasicMaterial({ color: new Color(palette.ball) }),
	);
	ball.position.set(...toWorld(point));
	return [shadow, segments([[x, y, 0], [...point]], { colour: palette.stem, width: 1.6 }), ball];
}

/**
 * The ellipsoid, as a body that lets everything through and its three largest circles.
 *
 * @param {Ellipsoid} ellipsoid @param {readonly number[]} point @param {Palette} palette
 */
function cloud({ axes, radii }, point, palette) {
	const colour = new Color(palette.ellipsoid);
	const body = new Mesh(
		new SphereGeometry(1, 40, 24),
		new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.22, depthWrite: false }),
	);
	const [a, b, c] = axes.map((axis, i) => new Vector3(...toWorld(axis)).multiplyScalar(Math.max(radii[i], 1e-4)));
	body.applyMatrix4(new Matrix4().makeBasis(a, b, c).setPosition(...toWorld(point)));
	const group = new Group();
	const outline = circles(axes, radii, point);
	group.add(body, segments(outline, { colour: palette.ellipsoid, width: 1.2, opacity: 0.8 }));
	return group;
}

/** @param {number[][]} axes @param {number[]} radii @param {readonly number[]} point */
function circles(axes, radii, point) {
	const steps = 48;
	return [[0, 1], [0, 2], [1, 2]].flatMap(([p, q]) => {
		/** @param {number} i */
		const at = (i) => {
			const angle = (2 * Math.PI * i) / steps;
			const [c, s] = [radii[p] * Math.cos(angle), radii[q] * Math.sin(angle)];
			return point.map((value, k) => value + c * axes[p][k] + s * axes[q][k]);
		};
		return Array.from({ length: steps }, (_, i) => [at(i), at(i + 1)]).flat();
	});
}
