// @ts-check
/** The magnifying glass: what is under the pointer, or the object that keys move, pixel by pixel. */

import { html } from 'htm/preact';
import { useCallback, useEffect, useState } from 'preact/hooks';

import { ballCenter, ballOf } from '../geometry/preview.js';
import { Canvas } from '../lib/canvas.js';
import { colours } from '../lib/colours.js';
import { fixed } from '../lib/format.js';
import { drawPixelGrid } from '../overlays/pixel_grid.js';
import { drawOverlays } from '../overlays/stage.js';
import { filterOf } from '../state/adjustments.js';
import { placeOf } from '../state/tab_order.js';
import { boxes, focused, gain, pointerPlace, projections, selected } from '../state/workspace.js';
import { useFrame } from './frame.js';

/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

const SIDE = 288;
const SCALES = [8, 12, 16, 24, 32];

/**
 * What the glass looks at: the selected object, so that it follows nudges, else the pointer.
 *
 * @param {ViewPicture[]} pictures
 * @returns {{picture: ViewPicture, at: ImagePoint} | null}
 */
function targetOf(pictures) {
	const object = selected.value;
	const chosen = pictures.find(({ view }) => view.key === object?.view);
	if (object && chosen) {
		const at = placeOf(object, chosen.view, chosen.predictions?.marks);
		if (at) return { picture: chosen, at };
	}
	const over = pointerPlace.value;
	const under = pictures.find(({ view }) => view.key === over?.view);
	if (over && under) return { picture: under, at: over.at };
	const near = pictures.find(({ view }) => view.letter === focused.value);
	const ball = near && ballOf(near.view);
	const at = ball && ballCenter(ball);
	return near && at ? { picture: near, at } : null;
}

/** The half of the window that the panel is not in. @param {string} letter */
function sideOf(letter) {
	const panel = document.querySelector(`.image-panel[data-view="${letter}"]`)?.getBoundingClientRect();
	return panel && panel.left + panel.width / 2 > innerWidth / 2 ? 'left' : 'right';
}

/** @param {{picture: ViewPicture, at: ImagePoint}} props */
function Glass({ picture, at }) {
	const [step, setStep] = useState(0);
	const { view } = picture;
	const { image } = useFrame(view.image);
	const filter = filterOf(view.letter);
	const scale = SCALES[step];
	const draw = useCallback((/** @type {CanvasRenderingContext2D} */ context) => {
		const viewport = {
			scale, left: SIDE / 2 - (at.x + 0.5) * scale, top: SIDE / 2 - (at.y + 0.5) * scale,
		};
		context.fillStyle = colours.value.stage;
		context.fillRect(0, 0, SIDE, SIDE);
		if (image) {
			context.imageSmoothingEnabled = false;
			context.filter = filter;
			context.drawImage(image, viewport.left, viewport.top, view.width * scale, view.height * scale);
			context.filter = 'none';
			drawPixelGrid(context, viewport, { width: SIDE, height: SIDE }, view.width / image.width);
		}
		drawOverlays(context, {
			picture, viewport, selected: selected.value, hidden: false, projections: projections.value,
			boxes: boxes.value, gain: gain.value, rays: selected.value?.kind === 'ball',
		});
	}, [picture, at.x, at.y, scale, image, filter]);
	useEffect(() => {
		/** @param {WheelEvent} event */
		function wheel(event) {
			event.preventDefault();
			event.stopPropagation();
			setStep((present) => Math.max(0, Math.min(SCALES.length - 1, present - Math.sign(event.deltaY))));
		}
		addEventListener('wheel', wheel, { passive: false, capture: true });
		return () => removeEventListener('wheel', wheel, { capture: true });
	}, []);
	return html`
		<figure class="loupe" data-side=${sideOf(view.letter)}>
			<${Canvas} width=${SIDE} height=${SIDE} draw=${draw} name=${`View ${view.letter} magnified`} />
			<figcaption>${view.letter} · ${fixed(at.x, 1)}, ${fixed(at.y, 1)} · ${scale}×</figcaption>
		</figure>
	`;
}

/** @param {{pictures: ViewPicture[]}} props */
export function Loupe({ pictures }) {
	const target = targetOf(pictures);
	return target ? html`<${Glass} key=${target.picture.view.key} ...${target} />` : null;
}
