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
