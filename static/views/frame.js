// @ts-check
/** The frame of a view, as it is drawn. */

import { useEffect, useState } from 'preact/hooks';

import { decoded, loadImage } from '../state/images.js';

/** The frame at an address: none while it loads, and none with an error. @param {string | null} url */
export function useFrame(url) {
	const [frame, setFrame] = useState(
		/** @type {{url: string | null, image: ImageBitmap | null, error: boolean}} */
		({ url: null, image: null, error: false }),
	);
	useEffect(() => {
		let wanted = true;
		if (url) {
			loadImage(url).then(
				(image) => { if (wanted) setFrame({ url, image, error: false }); },
				() => { if (wanted) setFrame({ url, image: null, error: true }); },
			);
		}
		return () => { wanted = false; };
	}, [url]);
	// A frame that was loaded ahead is there in the same moment as its group.
	return frame.url === url ? frame : { url, image: decoded(url), error: false };
}

/** Of its shape (width over height) a frame may differ from what was annotated; as in picture_scale.py. */
const SHAPES_APART = 0.005;

/**
 * Says that a frame has another shape than its annotations; empty where it has not, or is not loaded.
 *
 * @param {{width: number, height: number} | null | undefined} frame
 * @param {{width: number, height: number}} annotated
 */
export function otherShape(frame, annotated) {
	if (!frame) return '';
	const apart = frame.width / frame.height / (annotated.width / annotated.height) - 1;
	if (Math.abs(apart) <= SHAPES_APART) return '';
	return `The picture is ${frame.width} × ${frame.height}, annotated ${annotated.width} × ${annotated.height}: annotations lie in the wrong place. Correct the size in the file and import again.`;
}
