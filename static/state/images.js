// @ts-check
/** Frames as decoded images, the last few kept. */

import { getFrame } from '../api/client.js';

const KEPT = 32;

/** @type {Map<string, Promise<ImageBitmap>>} */
const images = new Map();

/**
 * The image at an address; loading it again costs nothing as long as it is kept.
 *
 * @param {string} url
 * @returns {Promise<ImageBitmap>}
 */
export function loadImage(url) {
	const kept = images.get(url);
	const loading = kept ?? decode(url);
	images.delete(url);
	images.set(url, loading);
	const oldest = images.keys().next().value;
	if (images.size > KEPT && oldest !== undefined) {
		images.delete(oldest);
		ready.delete(oldest);
	}
	if (!kept) loading.catch(() => images.delete(url));
	return loading;
}

/** Those that are decoded. @type {Map<string, ImageBitmap>} */
const ready = new Map();

/** The image at an address, if it can be drawn now. @param {string | null} url @returns {ImageBitmap | null} */
export function decoded(url) {
	return (url && ready.get(url)) || null;
}

/**
 * Decoded beside the page, and once: an <img> is decoded again for every canvas that draws it.
 *
 * @param {string} url
 */
async function decode(url) {
	const image = await createImageBitmap(await getFrame(url));
	if (images.has(url)) ready.set(url, image);
	return image;
}
