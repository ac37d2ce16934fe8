// @ts-check
/** The pitch as solid ground: grass, every marking, both goals with their nets. */

import { Color, DoubleSide, Group, Mesh, MeshBasicMaterial, PlaneGeometry } from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';

import { pitchMarkings } from '../../geometry/pitch.js';
import { toWorld } from './standpoints.js';

/** @import {Palette} from './scene_colours.js' */

const STRIPES = 18;
const SURROUND = 400;
/** Lines lie this much above the grass, metres, so that the two do not fight for the same pixels. */
const LIFT = 0.02;
const NET_DEPTH = 2;
const NET_STEPS = 6;

/**
 * Line segments of one width on screen.
 *
 * @param {readonly number[][]} points of the pitch frame, two for each segment
 * @param {{colour: string, width: number, dashed?: boolean, opacity?: number}} look width in CSS pixels
 * @returns {LineSegments2}
 */
export function segments(points, { colour, width, dashed = false, opacity = 1 }) {
	const geometry = new LineSegmentsGeometry();
	geometry.setPositions(points.flatMap(toWorld));
	const material = new LineMaterial({
		color: new Color(colour), linewidth: width, dashed, dashSize: 1.2, gapSize: 0.8,
		transparent: opacity < 1, opacity,
	});
	const lines = new LineSegments2(geometry, material);
	if (dashed) lines.computeLineDistances();
	return lines;
}

/** A polyline as segments. @param {readonly number[][]} line @returns {number[][]} */
function chained(line) {
	return line.slice(1).flatMap((point, i) => [[...line[i]], [...point]]);
}

/** @param {{length: number, width: number}} size @param {Palette} palette @returns {Group} */
export function pitchGroup({ length, width }, palette) {
	const group = new Group();
	group.add(ground(SURROUND, SURROUND, palette.ground, 0, -0.06));
	group.add(ground(length + 8, width + 8, palette.grass, 0, -0.03));
	for (let i = 0; i < STRIPES; i += 2) {
		const step = length / STRIPES;
		group.add(ground(step, width, palette['grass-stripe'], -length / 2 + (i + 0.5) * step, -0.01));
	}
	/** @type {number[][]} */
	const lines = [];
	/** @type {number[][]} */
	const goals = [];
	for (const [name, polyline] of pitchMarkings(length, width)) {
		const lifted = polyline.map(([x, y, z]) => [x, y, z - LIFT]);
		(name.startsWith('Goal') ? goals : lines).push(...chained(lifted));
	}
	group.add(segments(lines, { colour: palette.line, width: 1.6 }));
	group.add(segments(spots(length), { colour: palette.line, width: 3 }));
	group.add(segments(goals, { colour: palette.goal, width: 3 }));
	group.add(segments(nets(length), { colour: palette.goal, width: 1, opacity: 0.35 }));
	return group;
}

/** @param {number} length @param {number} width @param {string} colour @param {number} x @param {number} up */
function ground(length, width, colour, x, up) {
	const material = new MeshBasicMaterial({ color: new Color(colour), side: DoubleSide });
	const mesh = new Mesh(new PlaneGeometry(length, width), material);
	mesh.rotation.x = -Math.PI / 2;
	mesh.position.set(x, up, 0);
	mesh.name = 'ground';
	return mesh;
}

/** The centre mark and the penalty marks, as short strokes. @param {number} length */
function spots(length) {
	return [0, -length / 2 + 11, length / 2 - 11].flatMap((x) => [[x - 0.15, 0, -LIFT], [x + 0.15, 0, -LIFT]]);
}

/** @param {number} length @returns {number[][]} */
function nets(length) {
	const [half, height] = [7.32 / 2, 2.44];
	return [-1, 1].flatMap((side) => {
		const [front, back] = [(side * length) / 2, side * (length / 2 + NET_DEPTH)];
		return Array.from({ length: NET_STEPS + 1 }, (_, i) => i / NET_STEPS).flatMap((t) => {
			const y = -half + 2 * half * t;
			const z = -height * t;
			return [
				[front, y, -height], [back, y, -height * 0.7], [back, y, -height * 0.7], [back, y, 0],
				[front, -half, z], [back, -half, z * 0.7], [back, -half, z * 0.7], [back, half, z * 0.7],
				[back, half, z * 0.7], [front, half, z],
			];
		});
	});
}
