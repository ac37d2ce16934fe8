// @ts-check
/** Annotated points and their residual whiskers. */

import { gradeOfResidual } from '../geometry/residual.js';
import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { pixelText } from '../lib/format.js';
import { label, shareOf, strokeLine, UPPER_BORDER } from './pen.js';

/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {Grade} from '../geometry/residual.js' */
/** @import {Scene} from './scene.js' */

const RADIUS = 3.4;
const SHORTEST_WHISKER = 2;
/** Longer than this a whisker shows its residual as it is: it is seen well enough, CSS pixels. */
const LONG_WHISKER = 40;

/** From the projected line through the annotated point, `gain` times as long as it is where it would else be hard to see. */
/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawResidualLines(context, scene) {
	for (const { points } of scene.picture.markings) {
		for (const { point, nearest, distance } of points) {
			if (!nearest || distance === null) continue;
			drawResidualLine(context, scene, point, nearest, distance, gradeOfResidual(distance, scene.picture.gamma));
		}
	}
}

/**
 * @param {CanvasRenderingContext2D} context @param {Scene} scene
 * @param {ImagePoint} point @param {ImagePoint} nearest place on the marking
 * @param {number} distance image pixels @param {Grade} grade
 */
export function drawResidualLine(context, { viewport, gain }, point, nearest, distance, grade) {
	if (distance * gain * viewport.scale < SHORTEST_WHISKER) return;
	const shown = Math.max(1, Math.min(gain, LONG_WHISKER / (distance * viewport.scale)));
	const end = {
		x: nearest.x + shown * (point.x - nearest.x),
		y: nearest.y + shown * (point.y - nearest.y),
	};
	strokeLine(context, viewport, [nearest, end], {
		colour: colours.value[grade], width: grade === 'ok' ? 1 : 1.75, halo: grade !== 'ok',
	});
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawPoints(context, { picture, viewport }) {
	const share = shareOf(context);
	for (const { points, used, grade } of picture.markings) {
		for (const { point } of points) {
			const { x, y } = toScreen(viewport, point);
			context.beginPath();
			context.arc(x, y, RADIUS * share, 0, 2 * Math.PI);
			context.fillStyle = used ? colours.value.point : colours.value.bad;
			context.fill();
			context.lineWidth = Math.max(1, 1.6 * share);
			context.strokeStyle = grade === 'bad' ? colours.value.bad : colours.value.ink;
			context.stroke();
		}
	}
}

/** The ring around the selected point, with its name and number. */
/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawSelectedPoint(context, { picture, viewport, selected }) {
	if (selected?.kind !== 'point' || selected.view !== picture.view.key) return;
	const found = picture.markings.find(({ marking }) => marking === selected.marking);
	const residual = found?.points[selected.index];
	if (!residual) return;
	const { x, y } = toScreen(viewport, residual.point);
	context.beginPath();
	const share = shareOf(context);
	context.arc(x, y, (RADIUS + 4.5) * share, 0, 2 * Math.PI);
	context.lineWidth = 2;
	context.strokeStyle = colours.value.selected;
	context.stroke();
	const number = residual.distance === null ? '' : ` · ${pixelText(residual.distance)}`;
	const text = `${selected.marking} · point ${selected.index + 1}${number}`;
	const above = y - 18 > UPPER_BORDER;
	label(context, text, { x: x + 16, y: above ? y - 18 : y + 18 }, colours.value.point);
}
