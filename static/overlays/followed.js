// @ts-check
/** A followed ball: its way through the frames of a camera that stands still, and where it is in this one. */

import { boxCenter } from '../geometry/ball.js';
import { toScreen } from '../geometry/viewport.js';
import { colours } from '../lib/colours.js';
import { label, shareOf, widthOf } from './pen.js';

/** @import {FollowedItem} from '../api/follow.js' */
/** @import {Draw} from './scene.js' */

const DOT = 2;
/** The smallest ring, CSS pixels. */
const LEAST = 9;
const ROOMY = 240;

/** What draws followed balls in views of their camera. @param {FollowedItem[]} items @returns {Draw} */
export function followedDrawing(items) {
	return (context, { picture, viewport }) => {
		context.save();
		const share = shareOf(context);
		for (const { box, state } of items) {
			const { x, y } = toScreen(viewport, boxCenter(box));
			context.beginPath();
			context.arc(x, y, DOT * share + 0.5, 0, 2 * Math.PI);
			context.fillStyle = state === 'followed' ? colours.value.predicted : colours.value.warn;
			context.fill();
		}
		const here = picture.view.balls.length === 0 && items.find(({ view }) => view === picture.view.id);
		if (here) drawHere(context, toScreen(viewport, boxCenter(here.box)), Math.max(LEAST, (here.box[2] * viewport.scale) / 2 + 4), here);
		context.restore();
	};
}

/** A ring, and a word below it: what other views expect stands above. @param {CanvasRenderingContext2D} context @param {{x: number, y: number}} at @param {number} radius @param {FollowedItem} item */
function drawHere(context, at, radius, { state }) {
	const sure = state === 'followed';
	const colour = sure ? colours.value.predicted : colours.value.warn;
	context.beginPath();
	context.arc(at.x, at.y, radius, 0, 2 * Math.PI);
	context.strokeStyle = colours.value.halo;
	context.lineWidth = 4.5;
	context.stroke();
	context.setLineDash(sure ? [] : [3, 3]);
	context.strokeStyle = colour;
	context.lineWidth = 2.25;
	context.stroke();
	context.setLineDash([]);
	if (widthOf(context) >= ROOMY) label(context, sure ? 'followed' : 'followed, uncertain', { x: at.x + radius + 10, y: at.y + radius + 12 }, colour);
}
