// @ts-check
/** Small canvases that are drawn by a function of values. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

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
	useEffect(() => {
		const canvas = ref.current;
		const context = canvas?.getContext('2d');
		if (!canvas || !context || width <= 0 || height <= 0) return;
		const ratio = devicePixelRatio;
		canvas.width = Math.round(width * ratio);
		canvas.height = Math.round(height * ratio);
		canvas.style.width = `${width}px`;
		canvas.style.height = `${height}px`;
		context.setTransform(ratio, 0, 0, ratio, 0, 0);
		draw(context);
	}, [width, height, draw]);
	return name
		? html`<canvas ref=${ref} class=${className} role="img" aria-label=${name}></canvas>`
		: html`<canvas ref=${ref} class=${className} aria-hidden="true"></canvas>`;
}
