// @ts-check
/** Each view's ball cropped to the same physical window: the balls must look equally large. */

import { html } from 'htm/preact';
import { useCallback } from 'preact/hooks';

import { boxCenter } from '../geometry/ball.js';
import { ballCenter, ballOf } from '../geometry/preview.js';
import { gradeOfSize } from '../geometry/residual.js';
import { centeredOn } from '../geometry/viewport.js';
import { Canvas } from '../lib/canvas.js';
import { colours } from '../lib/colours.js';
import { fixed, pixelText } from '../lib/format.js';
import { useSize } from '../lib/hooks.js';
import { drawBall } from '../overlays/ball.js';
import { drawExpected } from '../overlays/expected_ball.js';
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
/** And these none for words. */
const NARROW = 76;
/** A letter with its number. */
const NUMBERED = 60;
/** Smaller crops show nothing. */
const SMALLEST = 24;

/**
 * What part of the image a crop shows.
 *
 * @param {ViewPicture} picture @param {PolicyJson} policy
 * @returns {{center: ImagePoint, side: number} | null} side in image pixels; null without a ball
 */
function windowOf({ view, solved, ball: fit, predictions }, policy) {
	const ball = ballOf(view);
	const offered = predictions?.marks.find(({ sure }) => sure)?.box;
	const center = (ball && ballCenter(ball))
		?? (solved?.expected && { x: solved.expected.place[0], y: solved.expected.place[1] })
		?? (offered && boxCenter(offered));
	if (!center) return null;
	const box = ball?.box ?? solved?.expected?.box ?? offered;
	const annotated = box ? (box[2] + box[3]) / 2 : null;
	const diameter = fit?.optimized_diameter_px ?? annotated;
	return { center, side: diameter ? (WINDOW_METRES * diameter) / policy.ball_diameter_m : 60 };
}

/** The diameter that the 3D ball asks for, or the annotated one. @param {ViewPicture} picture */
function sizeText({ view, ball, predictions }) {
	if (ball?.optimized_diameter_px) return `Ø ${pixelText(ball.optimized_diameter_px)}`;
	const box = ballOf(view)?.box;
	return box ? `box ${pixelText((box[2] + box[3]) / 2)}` : predictions?.marks.some(({ sure }) => sure) ? 'predicted' : '';
}

/** A crop is not more than this much longer one way than the other. */
const LONGEST = 2.2;

/**
 * Crops that fill the width of the card: as many columns as give the largest window.
 *
 * @param {number} n @param {number} width @param {number} height @param {number} least width of a crop
 */
function largest(n, width, height, least) {
	let best = { columns: 1, wide: 0, tall: 0, side: 0 };
	for (let columns = 1; columns <= n; columns++) {
		const rows = Math.ceil(n / columns);
		const wide = Math.floor((width - GAP * (columns - 1)) / columns);
		const room = Math.floor((height - GAP * (rows - 1)) / rows - CAPTION);
		const tall = Math.min(room, Math.floor(LONGEST * wide));
		const side = Math.min(wide, tall);
		if (wide >= least && side > best.side) best = { columns, wide, tall, side };
	}
	return best;
}

/**
 * The crops of a card, with a number below each where there is room for it.
 *
 * @param {number} n @param {number} width @param {number} height CSS pixels
 */
function layout(n, width, height) {
	const numbered = largest(n, width, height, NUMBERED);
	return numbered.side >= SMALLEST ? numbered : largest(n, width, height, 0);
}

/**
 * @param {{
 *   picture: ViewPicture, policy: PolicyJson, wide: number, tall: number, frame: ImageBitmap | undefined
 * }} props wide, tall: CSS pixels; the shorter of the two shows one metre
 */
function Crop({ picture, policy, wide, tall, frame }) {
	const { view, ball } = picture;
	const part = windowOf(picture, policy);
	const theme = colours.value;
	const filter = filterOf(view.letter);
	const draw = useCallback((/** @type {CanvasRenderingContext2D} */ context) => {
		context.fillStyle = theme.stage;
		context.fillRect(0, 0, wide, tall);
		if (!part) return;
		const scale = Math.min(wide, tall) / part.side;
		const viewport = centeredOn(part.center, { width: wide, height: tall }, scale);
		if (frame) {
			context.imageSmoothingEnabled = false;
			context.filter = filter;
			context.drawImage(frame, viewport.left, viewport.top, view.width * scale, view.height * scale);
			context.filter = 'none';
		}
		const scene = { picture, viewport, selected: null, hidden: false, projections: false, boxes: true, gain: 1, rays: false };
		// Where somebody said where the ball is, what was predicted would only be in the way.
		if (view.balls.length === 0) picture.predictions?.draw(context, scene);
		drawExpected(context, scene);
		drawBall(context, scene);
	}, [picture, wide, tall, frame, theme, filter]);
	return html`
		<li class="crop" style=${{ width: `${wide}px` }}>
			<button class="crop__button" type="button" title=${`Focus view ${view.letter}`} onClick=${() => focusView(view.letter)}>
				<${Canvas} class="crop__canvas" width=${wide} height=${tall} draw=${draw} name=${`Ball in view ${view.letter}`} />
			</button>
			<p class="crop__caption" data-narrow=${wide < NARROW}>
				<${Letter} letter=${view.letter} />
				${part && wide >= ROOMY ? html`<span>${sizeText(picture)}</span>` : null}
				${wide < NUMBERED ? null : part ? html`<span data-grade=${gradeOfSize(ball?.size_ratio)}>${ball?.size_ratio ? `${fixed(ball.size_ratio, 2)}×` : ''}</span>` : html`<span title="no ball">${wide >= NARROW ? 'no ball' : '–'}</span>`}
			</p>
		</li>
	`;
}

/** @param {{pictures: ViewPicture[], policy: PolicyJson}} props */
export function ContactSheet({ pictures, policy }) {
	const [ref, size] = useSize();
	const frames = useFrames(pictures.map(({ view }) => view));
	const { columns, wide, tall, side } = layout(pictures.length, size.width, size.height);
	return html`
		<section class="card strip-card" aria-label="Ball crops, each 1 m across">
			<h2 title="The shorter side of every crop is one metre at the ball: the balls must look equally large">Ball, 1 m crops</h2>
			<ul class="crops" ref=${ref} style=${{ gridTemplateColumns: `repeat(${columns}, max-content)` }}>
				${side < SMALLEST ? null : pictures.map((picture) => html`
					<${Crop}
						key=${picture.view.key} picture=${picture} policy=${policy} wide=${wide} tall=${tall}
						frame=${frames.get(picture.view.key)}
					/>`)}
			</ul>
		</section>
	`;
}
