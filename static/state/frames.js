// @ts-check
/** Frames as pixels, for those who sample them. */

import { useLayoutEffect, useState } from 'preact/hooks';

import { Kept } from '../lib/kept.js';
import { decoded, loadImage } from './images.js';

/** @import {ViewJson} from '../api/types.js' */

/** Frames whose pixels are kept: a large group's. Each takes four bytes a pixel. */
const KEPT = 8;

/** @type {Kept<ImageBitmap, ImageData>} */
const pixels = new Kept(KEPT);

/**
 * The frames of some views, by view key; those that are not there yet are missing.
 *
 * @param {ViewJson[]} views
 * @returns {Map<string, ImageBitmap>}
 */
export function useFrames(views) {
	const [frames, setFrames] = useState(/** @type {Map<string, ImageBitmap>} */ (new Map()));
	const urls = views.map((view) => view.image).join(' ');
	useLayoutEffect(() => {
		let wanted = true;
		const there = new Map(views.flatMap(({ key, image }) => {
			const frame = decoded(image);
			return frame ? [[key, frame]] : [];
		}));
		setFrames(there);
		for (const { key, image } of views) {
			if (!image || there.has(key)) continue;
			loadImage(image).then(
				(frame) => { if (wanted) setFrames((present) => new Map(present).set(key, frame)); },
				() => {},
			);
		}
		return () => { wanted = false; };
	}, [urls]);
	return frames;
}

/** Run something once nothing more urgent is to be done; the function returned calls it off. @param {() => void} work */
function whenIdle(work) {
	if (typeof requestIdleCallback !== 'function') {
		const timer = setTimeout(work, 60);
		return () => clearTimeout(timer);
	}
	const handle = requestIdleCallback(work, { timeout: 400 });
	return () => cancelIdleCallback(handle);
}

/**
 * The pixels of frames, by view key, as they are read: one at a time and between other work, for
 * reading one takes longer than drawing a group.
 *
 * @param {Map<string, ImageBitmap>} frames
 * @returns {Map<string, ImageData>}
 */
export function usePixels(frames) {
	const [read, setRead] = useState(0);
	useLayoutEffect(() => {
		// More than are kept would push each other out for ever.
		const next = [...frames.values()].slice(0, KEPT).find((frame) => !pixels.has(frame));
		return next && whenIdle(() => {
			pixelsOf(next);
			setRead(read + 1);
		});
	}, [frames, read]);
	return new Map([...frames].flatMap(([key, frame]) => {
		const data = pixels.get(frame);
		return data ? [[key, data]] : [];
	}));
}

/**
 * The pixels of a frame, read once.
 *
 * @param {ImageBitmap} frame
 * @returns {ImageData}
 */
function pixelsOf(frame) {
	const present = pixels.get(frame);
	if (present) return present;
	const canvas = new OffscreenCanvas(frame.width, frame.height);
	const context = /** @type {OffscreenCanvasRenderingContext2D} */ (
		canvas.getContext('2d', { willReadFrequently: true })
	);
	context.drawImage(frame, 0, 0);
	const data = context.getImageData(0, 0, canvas.width, canvas.height);
	pixels.set(frame, data);
	return data;
}
