// @ts-check
/** Pictures with the paint of their views, while it is shown; its code is loaded with it. */

import { useEffect, useMemo, useState } from 'preact/hooks';

import { residualLines } from '../state/workspace.js';

/** @import {GroupDocument} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */
/** @import {KnownPaint} from '../state/review_paint.js' */

/** @typedef {typeof import('../overlays/residual_lines.js').viewPaint} Draw */

/**
 * @param {ViewPicture[]} pictures @param {GroupDocument | null} saved
 * @returns {ViewPicture[]}
 */
export function usePaint(pictures, saved) {
	const wanted = residualLines.value;
	const [read, setRead] = useState(/** @type {{group: number, known: KnownPaint, draw: Draw} | null} */ (null));
	useEffect(() => {
		if (!wanted || !saved) return undefined;
		const controller = new AbortController();
		Promise.all([import('../state/review_paint.js'), import('../overlays/residual_lines.js')]).then(([{ readAllPaint }, { viewPaint }]) => (
			readAllPaint(saved, controller.signal, (known) => setRead({ group: saved.id, known, draw: viewPaint }))
		));
		return () => controller.abort();
	}, [wanted, saved?.id, saved?.etag]);
	return useMemo(() => {
		if (!wanted || !read || read.group !== saved?.id) return pictures;
		return pictures.map((picture) => {
			const paint = read.known.get(picture.view.key);
			return paint ? { ...picture, paint: read.draw(picture, paint) } : picture;
		});
	}, [wanted, read, pictures, saved?.id]);
}
