// @ts-check
/** Little scenes for the legend, drawn by the very functions that draw the real ones. */

import { colours } from '../../lib/colours.js';
import { gradeOfResidual } from '../../geometry/residual.js';

/** @import {Scene, ViewPicture} from '../../overlays/scene.js' */
/** @import {Grade, MarkingResiduals} from '../../geometry/residual.js' */
/** @import {BallJson, GroupDocument} from '../../api/types.js' */
/** @import {ImagePoint} from '../../geometry/camera.js' */

export const WIDTH = 132;
export const HEIGHT = 52;
/** Gamma of the little scenes, pixels. */
const GAMMA = 8;
const VIEW = 'legend';

/** @param {Partial<ViewPicture>} picture @param {Partial<Scene>} [scene] @param {BallJson[]} [balls] @returns {Scene} */
export function sceneOf(picture, scene = {}, balls = []) {
	const view = /** @type {GroupDocument['views'][number]} */ (/** @type {unknown} */ (
		{ key: VIEW, letter: 'A', width: WIDTH, height: HEIGHT, balls, lines: {}, included: true }
	));
	return {
		picture: {
			view, solved: null, ball: null, apart: null, gamma: GAMMA, tau: 2 * GAMMA, markings: [], outline: [], epipolars: [], pins: [], ...picture,
		},
		viewport: { scale: 1, left: 0, top: 0 },
		selected: null, hidden: false, projections: true, boxes: true, gain: 1, rays: true, ...scene,
	};
}

/**
 * A line across, with a point that lies `off` pixels below it.
 *
 * @param {Grade} grade @param {number | null} off @param {Partial<MarkingResiduals>} [more]
 * @returns {MarkingResiduals}
 */
export function lineOf(grade, off, more = {}) {
	const [from, to] = [{ x: 8, y: 30 }, { x: WIDTH - 8, y: 20 }];
	const on = { x: 66, y: 25.3 };
	const points = off === null ? [] : [{ point: { x: on.x, y: on.y + off }, nearest: on, distance: off }];
	return { marking: 'Middle line', grade, largest: off, points, polyline: [from, to], used: true, ...more };
}

/** The grade that a distance has in these scenes. @param {number} off */
export function gradeAt(off) {
	return gradeOfResidual(off, GAMMA);
}

/** @param {Partial<BallJson>} [more] @returns {BallJson} */
export function ballAt(more = {}) {
	return /** @type {BallJson} */ (/** @type {unknown} */ ({ box: [53, 13, 26, 26], point: null, occluded: false, out_of_view: false, ...more }));
}

/** A circle in image points. @param {number} x @param {number} y @param {number} r @returns {ImagePoint[]} */
export function circle(x, y, r) {
	return Array.from({ length: 32 }, (_, i) => ({ x: x + r * Math.cos(i * Math.PI / 16), y: y + r * Math.sin(i * Math.PI / 16) }));
}

/** Key of the view in these scenes. */
export const KEY = VIEW;

/** What lies under a mark: grass, as a frame has it. @param {CanvasRenderingContext2D} context */
export function drawGrass(context) {
	context.fillStyle = colours.value.grass;
	context.fillRect(0, 0, WIDTH, HEIGHT);
}
