// @ts-check
/** Frames as decoded images, the last few kept. */

import { getFrame } from '../api/client.js';
import { Kept } from '../lib/kept.js';

/** @type {Kept<string, Promise<ImageBitmap>>} */
const images = new Kept(32);
/** Those that are decoded. @type {WeakMap<Promise<ImageBitmap>, ImageBitmap>} */
const ready = new WeakMap();

/**
 * The image at an address; loading it again costs nothing as long as it is kept.
 *
 * @param {string} url
 * @returns {Promise<ImageBitmap>}
 */
export function loadImage(url) {
	const kept = images.get(url);
	const loading = kept ?? decode(url);
	images.set(url, loading);
	if (!kept) loading.then((image) => ready.set(loading, image), () => images.delete(url));
	return loading;
}

/** The image at an address, if it can be drawn now. @param {string | null} url @returns {ImageBitmap | null} */
export function decoded(url) {
	const loading = url && images.get(url);
	return (loading && ready.get(loading)) || null;
}

/**
 * Decoded beside the page, and once: an <img> is decoded again for every canvas that draws it.
 *
 * @param {string} url
 */
async function decode(url) {
	return createImageBitmap(await getFrame(url));
}
