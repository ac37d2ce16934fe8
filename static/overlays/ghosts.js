// @ts-check
/** What a conflict keeps: my version dotted, and what both began with, beside theirs. */

import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { label, strokeBox, strokeLine } from './pen.js';

/** @import {BallJson, PointJson} from '../api/types.js' */
/** @import {Marked} from '../state/conflict.js' */
/** @import {Scene} from './scene.js' */

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawGhosts(context, scene) {
	const { ghosts = [], picture } = scene;
	for (const { view, kind, base, mine, unchanged } of ghosts) {
		if (view !== picture.view.key) continue;
		for (const { value, word, colour } of [
			{ value: base, word: 'before', colour: colours.value.muted },
			...(unchanged ? [] : [{ value: mine, word: 'yours', colour: colours.value.selected }]),
		]) {
			if (kind === 'ball') ghostBall(context, scene, /** @type {BallJson[]} */ (value), word, colour);
			else if (kind === 'lines') ghostLine(context, scene, /** @type {Marked} */ (value).points, word, colour);
		}
	}
}

/**
 * @param {CanvasRenderingContext2D} context @param {Scene} scene @param {BallJson[]} balls
 * @param {string} word @param {string} colour
 */
function ghostBall(context, { viewport }, balls, word, colour) {
	const box = balls?.[0]?.box;
	if (!box) return;
	strokeBox(context, viewport, box, { colour, width: 1.75, dash: [2, 3] });
	const at = toScreen(viewport, { x: box[0] + box[2], y: box[1] + (word === 'yours' ? 0 : box[3]) });
	label(context, word, { x: at.x + 10, y: at.y }, colour);
}

/**
 * @param {CanvasRenderingContext2D} context @param {Scene} scene @param {PointJson[] | null} points
 * @param {string} word @param {string} colour
 */
function ghostLine(context, { viewport }, points, word, colour) {
	if (!points?.length) return;
	strokeLine(context, viewport, points, { colour, width: 1.75, dash: [2, 4] });
	const at = toScreen(viewport, points[0]);
	label(context, word, { x: at.x + 10, y: at.y - (word === 'yours' ? 12 : -12) }, colour);
}
