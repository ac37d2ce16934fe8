// @ts-check
/** Small canvases that are drawn by a function of values. */

import { html } from 'htm/preact';
import { useLayoutEffect, useRef } from 'preact/hooks';

/** A new size takes new memory, even where it is the old one. @param {HTMLCanvasElement} canvas @param {number} width @param {number} height pixels */
function resize(canvas, width, height) {
	const [wide, high] = [Math.round(width), Math.round(height)];
	if (canvas.width !== wide) canvas.width = wide;
	if (canvas.height !== high) canvas.height = high;
}

/**
 * A canvas of a size in CSS pixels, sharp on every screen.
 *
 * @param {{
 *   width: number, height: number, name: string, class?: string,
 *   draw: (context: CanvasRenderingContext2D) => void
 * }} props `draw` changes when the drawing does; an empty `name` says that it only decorates
 */
export function Canvas({ width, height, name, draw, class: className }) {
	const ref = useRef(/** @type {HTMLCanvasElement | null} */ (null));
	useLayoutEffect(() => {
		// What changes until the next frame is drawn once.
		const frame = requestAnimationFrame(() => {
			const canvas = ref.current;
			const context = canvas?.getContext('2d');
			if (!canvas || !context || width <= 0 || height <= 0) return;
			const ratio = devicePixelRatio;
			resize(canvas, width * ratio, height * ratio);
			canvas.style.width = `${width}px`;
			canvas.style.height = `${height}px`;
			context.reset();
			context.setTransform(ratio, 0, 0, ratio, 0, 0);
			draw(context);
		});
		return () => cancelAnimationFrame(frame);
	}, [width, height, draw]);
	return name
		? html`<canvas ref=${ref} class=${className} role="img" aria-label=${name}></canvas>`
		: html`<canvas ref=${ref} class=${className} aria-hidden="true"></canvas>`;
}
