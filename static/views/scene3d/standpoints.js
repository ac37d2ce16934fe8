// @ts-check
/**
 * From where one looks at the scene: orbits about a target, and the cameras themselves.
 *
 * World frame of the 3D library: x as in the pitch frame, y up (-z of the pitch frame), z towards
 * the near side line (y of the pitch frame). This file is the one place where the two meet.
 */

import { clamp, fit } from '../../geometry/viewport.js';

/** @import {Camera} from '../../geometry/camera.js' */
/** @import {Size} from '../../geometry/viewport.js' */
/** @import {Preset} from '../../state/scene3d.js' */
/** @import {SceneValues} from './values.js' */

/** @typedef {[number, number, number]} WorldPoint   metres, y up */
/**
 * @typedef {object} Orbit
 * @property {WorldPoint} target
 * @property {number} distance metres
 * @property {number} azimuth radians; 0 looks from the near side line across the pitch
 * @property {number} elevation radians above the grass
 */

const NEAREST = 0.5;
const FARTHEST = 1200;
const LOWEST = 0.01;
const HIGHEST = Math.PI / 2 - 0.001;
/** Vertical field of view of the free camera, radians. */
const FIELD = (38 * Math.PI) / 180;
const NEAR = 0.1;
const FAR = 2000;

/** @param {readonly number[]} point of the pitch frame @returns {WorldPoint} */
export function toWorld([x, y, z]) {
	return [x, -z, y];
}

/** Where the eye of an orbit stands. @param {Orbit} orbit @returns {WorldPoint} */
export function eyeOf({ target, distance, azimuth, elevation }) {
	const flat = distance * Math.cos(elevation);
	return [
		target[0] + flat * Math.sin(azimuth),
		target[1] + distance * Math.sin(elevation),
		target[2] + flat * Math.cos(azimuth),
	];
}

/** @param {Orbit} orbit @param {number} azimuth radians @param {number} elevation radians @returns {Orbit} */
export function turned(orbit, azimuth, elevation) {
	return {
		...orbit,
		azimuth: orbit.azimuth + azimuth,
		elevation: clamp(orbit.elevation + elevation, LOWEST, HIGHEST),
	};
}

/** @param {Orbit} orbit @param {number} factor below 1 comes closer @returns {Orbit} */
export function approached(orbit, factor) {
	return { ...orbit, distance: clamp(orbit.distance * factor, NEAREST, FARTHEST) };
}

/** The orbit with its target moved as that of a preset has moved. @param {Orbit} orbit @param {Orbit} before @param {Orbit} after @returns {Orbit} */
export function carried(orbit, before, after) {
	return { ...orbit, target: /** @type {WorldPoint} */ (orbit.target.map((value, i) => value + after.target[i] - before.target[i])) };
}

/**
 * The orbit with its target moved in the plane of the screen.
 *
 * @param {Orbit} orbit @param {number} right share of the screen's height @param {number} down
 * @returns {Orbit}
 */
export function shifted(orbit, right, down) {
	const span = 2 * orbit.distance * Math.tan(FIELD / 2);
	const { azimuth, elevation } = orbit;
	const [x, y, z] = orbit.target;
	const ahead = down * span * Math.sin(elevation);
	return {
		...orbit,
		target: [
			x - right * span * Math.cos(azimuth) - ahead * Math.sin(azimuth),
			Math.max(0, y + down * span * Math.cos(elevation)),
			z + right * span * Math.sin(azimuth) - ahead * Math.cos(azimuth),
		],
	};
}

/**
 * The orbit of a preset.
 *
 * @param {Preset} preset @param {SceneValues} scene @param {number} aspect width over height
 * @returns {Orbit}
 */
export function presetOrbit(preset, scene, aspect) {
	const { length, width } = scene.pitch;
	const ball = scene.best ?? scene.ball;
	const tall = Math.tan(FIELD / 2);
	if (preset === 'ball' && ball) {
		const reach = Math.max(0.4, ...(ball.ellipsoid?.radii ?? []));
		return { target: toWorld(ball.point), distance: (1.5 * reach) / tall + 0.6, azimuth: 0.35, elevation: 0.3 };
	}
	if (preset === 'top') {
		const distance = Math.max((width / 2 + 6) / tall, (length / 2 + 6) / (tall * aspect));
		return { target: [0, 0, 0], distance, azimuth: 0, elevation: HIGHEST };
	}
	if (preset === 'side') {
		const distance = (length / 2 + 6) / (tall * aspect) + width / 2;
		return { target: [0, 4, 0], distance, azimuth: 0, elevation: 0.04 };
	}
	if (preset === 'goal') {
		const side = (ball?.point[0] ?? 1) < 0 ? -1 : 1;
		return { target: [side * (length / 2 - 8), 1, 0], distance: 46, azimuth: -side * 1.15, elevation: 0.24 };
	}
	return framing(wholeOf(scene), { azimuth: 0, elevation: 0.62 }, aspect);
}

/** Shares of the panel that *Whole* leaves free: cameras carry their letters above them. */
const MARGINS = { side: 0.06, top: 0.14, bottom: 0.05 };
/** Metres of grass around the lines. */
const GRASS = 4;
/** A camera farther than this from the middle of the pitch is a mistake; showing it would make all else a dot. */
const MISTAKEN = 400;

/** What *Whole* must show: the corners of the pitch and every camera. @param {SceneValues} scene @returns {WorldPoint[]} */
function wholeOf({ pitch: { length, width }, stands }) {
	const [l, w] = [length / 2 + GRASS, width / 2 + GRASS];
	const corners = /** @type {WorldPoint[]} */ ([[-l, 0, -w], [l, 0, -w], [l, 0, w], [-l, 0, w]]);
	return [...corners, ...stands.flatMap(({ camera, corners: ends }) => (
		Math.hypot(...camera.C) > MISTAKEN ? [] : [camera.C, ...ends].map(toWorld)
	))];
}

/**
 * The orbit that shows all points as large as the panel allows.
 *
 * Seen along one direction a point at depth `d` in front of the target stands at `right / (D - d)`
 * of an eye at distance `D`; each edge of the panel therefore asks for
 * `D >= d + (right - middle) / tan`, which is linear: the middle that makes opposite edges ask for
 * the same is found in closed form.
 *
 * @param {WorldPoint[]} points @param {{azimuth: number, elevation: number}} from @param {number} aspect
 * @returns {Orbit}
 */
function framing(points, { azimuth, elevation }, aspect) {
	const tall = Math.tan(FIELD / 2);
	const [sin, cos, rise, flat] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
	const right = [cos, 0, -sin];
	const up = [-rise * sin, flat, -rise * cos];
	const back = [flat * sin, rise, flat * cos];
	const seen = points.map((point) => [right, up, back].map((axis) => axis.reduce((sum, value, i) => sum + value * point[i], 0)));
	/** @param {number} axis @param {number} low tangent of the lower edge @param {number} high of the upper @returns {[number, number]} middle and distance */
	const edges = (axis, low, high) => {
		// D - d >= (value - m) / high and D - d >= (m - value) / low for every point.
		const above = Math.max(...seen.map((point) => point[2] + point[axis] / high));
		const below = Math.max(...seen.map((point) => point[2] - point[axis] / low));
		const middle = (above - below) / (1 / high + 1 / low);
		return [middle, above - middle / high];
	};
	const side = tall * aspect * (1 - 2 * MARGINS.side);
	const [across, wide] = edges(0, side, side);
	const [along, high] = edges(1, tall * (1 - 2 * MARGINS.bottom), tall * (1 - 2 * MARGINS.top));
	// The same eye, but turning about a place on the grass.
	const ahead = -(along * up[1]) / rise;
	const target = /** @type {WorldPoint} */ ([0, 1, 2].map((i) => across * right[i] + along * up[i] + ahead * back[i]));
	return { target: [target[0], 0, target[2]], distance: Math.max(wide, high) - ahead, azimuth, elevation };
}

/**
 * The orbit between two others.
 *
 * @param {Orbit} a @param {Orbit} b @param {number} t 0 is a, 1 is b
 * @returns {Orbit}
 */
export function between(a, b, t) {
	/** @param {number} from @param {number} to */
	const mix = (from, to) => from + t * (to - from);
	// The short way round.
	const turn = Math.atan2(Math.sin(b.azimuth - a.azimuth), Math.cos(b.azimuth - a.azimuth));
	return {
		target: [mix(a.target[0], b.target[0]), mix(a.target[1], b.target[1]), mix(a.target[2], b.target[2])],
		distance: a.distance * (b.distance / a.distance) ** t,
		azimuth: a.azimuth + t * turn,
		elevation: mix(a.elevation, b.elevation),
	};
}

/**
 * Projection of the free camera, OpenGL's, row by row.
 *
 * @param {number} aspect width over height
 * @returns {number[]} 16 numbers
 */
export function freeProjection(aspect) {
	const f = 1 / Math.tan(FIELD / 2);
	return projection([f / aspect, 0, 0], [0, f, 0]);
}

/**
 * Projection that shows in a panel what a camera shows in its image, the whole image in sight.
 *
 * The lens is left out: the picture behind is straightened instead.
 *
 * @param {Camera} camera @param {Size} image @param {Size} panel
 * @returns {number[]} 16 numbers, row by row
 */
export function cameraProjection(camera, image, panel) {
	const { scale, left, top } = fit(image, panel);
	const [fx, fy] = camera.focal;
	const [x0, y0] = camera.principal;
	const [w, h] = [panel.width / (2 * scale), panel.height / (2 * scale)];
	const middleX = (x0 + 0.5 + left / scale) / w - 1;
	const middleY = 1 - (y0 + 0.5 + top / scale) / h;
	// The library's camera looks along its -z with y up; image rows grow downwards.
	return projection([fx / w, -camera.skew / w, -middleX], [0, fy / h, -middleY]);
}

/** @param {number[]} first @param {number[]} second @returns {number[]} */
function projection(first, second) {
	const depth = (FAR + NEAR) / (NEAR - FAR);
	const shift = (2 * FAR * NEAR) / (NEAR - FAR);
	return [...first, 0, ...second, 0, 0, 0, depth, shift, 0, 0, -1, 0];
}

/**
 * Axes of a camera in the world, as the library wants them: right, up, backwards.
 *
 * @param {Camera} camera
 * @returns {WorldPoint[]}
 */
export function axesOf(camera) {
	const [right, down, ahead] = camera.R;
	return [toWorld(right), toWorld(down.map((value) => -value)), toWorld(ahead.map((value) => -value))];
}
