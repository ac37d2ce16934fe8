// @ts-check
/** Frames as pixels, for those who sample them. */

import { useEffect, useState } from 'preact/hooks';

import { loadImage } from './images.js';

/** @import {ViewJson} from '../api/types.js' */

/** Frames whose pixels are kept: a large group's. Each takes four bytes a pixel. */
const KEPT = 8;

/** @type {Map<HTMLImageElement, ImageData>} */
const pixels = new Map();

/**
 * The frames of some views, by view key; those that are not there yet are missing.
 *
 * @param {ViewJson[]} views
 * @returns {Map<string, HTMLImageElement>}
 */
export function useFrames(views) {
	const [frames, setFrames] = useState(/** @type {Map<string, HTMLImageElement>} */ (new Map()));
	const urls = views.map((view) => view.image).join(' ');
	useEffect(() => {
		let wanted = true;
		setFrames(new Map());
		for (const { key, image } of views) {
			if (!image) continue;
			loadImage(image).then(
				(frame) => { if (wanted) setFrames((present) => new Map(present).set(key, frame)); },
				() => {},
			);
		}
		return () => { wanted = false; };
	}, [urls]);
	return frames;
}

/**
 * The pixels of a frame, read once.
 *
 * @param {HTMLImageElement} frame
 * @returns {ImageData}
 */
export function pixelsOf(frame) {
	const present = pixels.get(frame);
	if (present) return present;
	const canvas = new OffscreenCanvas(frame.naturalWidth, frame.naturalHeight);
	const context = /** @type {OffscreenCanvasRenderingContext2D} */ (
		canvas.getContext('2d', { willReadFrequently: true })
	);
	context.drawImage(frame, 0, 0);
	const data = context.getImageData(0, 0, canvas.width, canvas.height);
	pixels.set(frame, data);
	const oldest = pixels.keys().next().value;
	if (pixels.size > KEPT && oldest) pixels.delete(oldest);
	return data;
}
