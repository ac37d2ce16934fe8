// @ts-check
/** Each view's ball cropped to the same physical window: the balls must look equally large. */

import { html } from 'htm/preact';
import { useCallback } from 'preact/hooks';

import { ballCenter, ballOf } from '../geometry/preview.js';
import { gradeOfSize } from '../geometry/residual.js';
import { Canvas } from '../lib/canvas.js';
import { colours } from '../lib/colours.js';
import { fixed, pixels } from '../lib/format.js';
import { useSize } from '../lib/hooks.js';
import { drawBall } from '../overlays/ball.js';
import { filterOf } from '../state/adjustments.js';
import { useFrames } from '../state/frames.js';
import { focusView } from '../state/workspace.js';
import { Letter } from './letter.js';

/** @import {PolicyJson} from '../api/types.js' */
/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

const WINDOW_METRES = 1;
const CAPTION = 26;
const GAP = 8;
/** Crops narrower than this have no room for the diameter. */
const ROOMY = 124;

/**
 * What part of the image a crop shows.
 *
 * @param {ViewPicture} picture @param {PolicyJson} policy
 * @returns {{center: ImagePoint, side: number} | null} side in image pixels; null without a ball
 */
function windowOf({ view, ball: fit }, policy) {
	const ball = ballOf(view);
	const center = (ball && ballCenter(ball))
		?? (fit?.reprojected && { x: fit.reprojected[0], y: fit.reprojected[1] });
	if (!center) return null;
	const annotated = ball?.box ? (ball.box[2] + ball.box[3]) / 2 : null;
	const diameter = fit?.optimized_diameter_px ?? annotated;
	return { center, side: diameter ? (WINDOW_METRES * diameter) / policy.ball_diameter_m : 60 };
}

/** The diameter that the 3D ball asks for, or the annotated one. @param {ViewPicture} picture */
function sizeText({ view, ball }) {
	if (ball?.optimized_diameter_px) return `Ø ${pixels(ball.optimized_diameter_px)} px`;
	const box = ballOf(view)?.box;
	return box ? `box ${pixels((box[2] + box[3]) / 2)} px` : '';
}

/** How many columns make the largest squares. @param {number} n @param {number} width @param {number} height */
function layout(n, width, height) {
	let best = { columns: 1, side: 0 };
	for (let columns = 1; columns <= n; columns++) {
		const rows = Math.ceil(n / columns);
		const wide = (width - GAP * (columns - 1)) / columns;
		const tall = (height - GAP * (rows - 1)) / rows - CAPTION;
		const side = Math.floor(Math.min(wide, tall));
		if (side > best.side) best = { columns, side };
	}
	return best;
}

/**
 * @param {{
 *   picture: ViewPicture, policy: PolicyJson, side: number, frame: ImageBitmap | undefined
 * }} props
 */
function Crop({ picture, policy, side, frame }) {
	const { view, ball } = picture;
	const part = windowOf(picture, policy);
	const theme = colours.value;
	const filter = filterOf(view.letter);
	const draw = useCallback((/** @type {CanvasRenderingContext2D} */ context) => {
		context.fillStyle = theme.stage;
		context.fillRect(0, 0, side, side);
		if (!part) return;
		const scale = side / part.side;
		const viewport = {
			scale,
			left: side / 2 - (part.center.x + 0.5) * scale,
			top: side / 2 - (part.center.y + 0.5) * scale,
		};
		if (frame) {
			context.imageSmoothingEnabled = false;
			context.filter = filter;
			context.drawImage(frame, viewport.left, viewport.top, view.width * scale, view.height * scale);
			context.filter = 'none';
		}
		drawBall(context, {
			picture, viewport, selected: null, hidden: false, projections: false, boxes: true, gain: 1, rays: false,
		});
	}, [picture, side, frame, theme, filter]);
	return html`
		<li class="crop" style=${{ width: `${side}px` }}>
			<button class="crop__button" type="button" title=${`Focus view ${view.letter}`} onClick=${() => focusView(view.letter)}>
				<${Canvas} class="crop__canvas" width=${side} height=${side} draw=${draw} name=${`Ball in view ${view.letter}`} />
			</button>
			<p class="crop__caption">
				<${Letter} letter=${view.letter} />
				${part && side >= ROOMY ? html`<span>${sizeText(picture)}</span>` : null}
				${part ? html`<span data-grade=${gradeOfSize(ball?.size_ratio)}>${ball?.size_ratio ? `${fixed(ball.size_ratio, 2)}×` : ''}</span>` : html`<span>no ball</span>`}
			</p>
		</li>
	`;
}

/** @param {{pictures: ViewPicture[], policy: PolicyJson}} props */
export function ContactSheet({ pictures, policy }) {
	const [ref, size] = useSize();
	const frames = useFrames(pictures.map(({ view }) => view));
	const { side } = layout(pictures.length, size.width, size.height);
	return html`
		<section class="card strip-card" aria-label="Ball, one metre window">
			<h2>Ball, 1 m window</h2>
			<ul class="crops" ref=${ref}>
				${side < 24 ? null : pictures.map((picture) => html`
					<${Crop}
						key=${picture.view.key} picture=${picture} policy=${policy} side=${side}
						frame=${frames.get(picture.view.key)}
					/>`)}
			</ul>
		</section>
	`;
}
