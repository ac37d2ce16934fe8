// @ts-check
/** The ball: what a person drew (solid), what fits the 3D point (dashed), where that point is. */

import { ballCenter, ballOf } from '../geometry/preview.js';
import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { label, shareOf, strokeBox, strokeCross, strokeLine, widthOf } from './pen.js';
import { CORNERS_FROM } from './sizes.js';

/** @import {Scene} from './scene.js' */

const CORNER = 3.5;
const SMALL = 90;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawBall(context, scene) {
	drawReprojected(context, scene);
	if (scene.boxes) drawBoxes(context, scene);
	drawAnnotated(context, scene);
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
function drawReprojected(context, { picture, viewport }) {
	const at = picture.ball?.reprojected;
	if (!at) return;
	const stroke = { colour: colours.value.reprojected, width: 1.5, halo: true };
	strokeLine(context, viewport, picture.outline, { ...stroke, closed: true });
	// On a small crop the outline says enough.
	if (widthOf(context) < SMALL) return;
	const share = shareOf(context);
	const radius = Math.max(9 * share, (viewport.scale * (picture.ball?.optimized_diameter_px ?? 0)) / 2 + 3);
	strokeCross(context, toScreen(viewport, { x: at[0], y: at[1] }), radius, radius + 8 * share, stroke);
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
function drawBoxes(context, { picture, viewport }) {
	// Only a view in a valid pair helped to find the 3D ball, so only it has a box made from it.
	const optimised = picture.solved?.included ? picture.ball?.optimized_box : null;
	if (optimised) {
		strokeBox(context, viewport, optimised, {
			colour: colours.value.optimised, width: 1.5, dash: [4, 3],
		});
	}
	const seen = picture.view.balls.filter((ball) => ball.box);
	seen.forEach((ball, i) => {
		if (!ball.box) return;
		strokeBox(context, viewport, ball.box, {
			// One that was put where the others see the ball looks like what it rests on.
			colour: ball.inferred ? colours.value.reprojected : colours.value.human, width: 1.75, dash: ball.out_of_view || ball.inferred ? [2, 4] : [],
		});
		if (seen.length < 2) return;
		const corner = toScreen(viewport, { x: ball.box[0] + ball.box[2], y: ball.box[1] });
		label(context, `ball ${i + 1}`, { x: corner.x + 10, y: corner.y }, colours.value.human);
	});
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
function drawAnnotated(context, { picture, viewport, selected }) {
	const ball = ballOf(picture.view);
	const center = ball && ballCenter(ball);
	if (!ball || !center) return;
	const chosen = selected?.kind === 'ball' && selected.view === picture.view.key;
	const colour = chosen ? colours.value.selected : colours.value.human;
	if (!ball.box) {
		const at = toScreen(viewport, center);
		context.beginPath();
		context.arc(at.x, at.y, 6 * shareOf(context), 0, 2 * Math.PI);
		context.lineWidth = 1.75;
		context.strokeStyle = colour;
		context.stroke();
	} else if (chosen) {
		drawChosenBox(context, viewport, ball.box);
	}
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {import('../geometry/viewport.js').Viewport} viewport
 * @param {[number, number, number, number]} box
 */
function drawChosenBox(context, viewport, box) {
	strokeBox(context, viewport, box, { colour: colours.value.selected, width: 2 });
	if (Math.min(box[2], box[3]) * viewport.scale < CORNERS_FROM) return;
	for (const [x, y] of [[0, 0], [1, 0], [0, 1], [1, 1]]) {
		const at = toScreen(viewport, { x: box[0] + x * box[2], y: box[1] + y * box[3] });
		context.fillStyle = colours.value.selected;
		context.fillRect(at.x - CORNER, at.y - CORNER, 2 * CORNER, 2 * CORNER);
	}
}
