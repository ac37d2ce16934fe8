// @ts-check
/** What part of an image a panel shows: image pixels to CSS pixels and back. */

/** @typedef {{x: number, y: number}} ImagePoint   image pixels */
/** @typedef {{x: number, y: number}} ScreenPoint  CSS pixels in the panel */
/** @typedef {{width: number, height: number}} Size */
/** @typedef {{readonly scale: number, readonly left: number, readonly top: number}} Viewport */

const CLOSEST = 64;

/**
 * The whole image, as large as the panel allows, in its middle.
 *
 * @param {Size} image @param {Size} panel
 * @returns {Viewport}
 */
export function fit(image, panel) {
	const scale = Math.min(panel.width / image.width, panel.height / image.height);
	return {
		scale,
		left: (panel.width - image.width * scale) / 2,
		top: (panel.height - image.height * scale) / 2,
	};
}

/**
 * The same viewport, `factor` times closer, with `anchor` left where it is.
 *
 * @param {Viewport} viewport @param {ScreenPoint} anchor @param {number} factor
 * @param {number} farthest the smallest scale allowed
 * @returns {Viewport}
 */
export function zoomAbout(viewport, anchor, factor, farthest) {
	const scale = Math.min(CLOSEST, Math.max(farthest, viewport.scale * factor));
	const applied = scale / viewport.scale;
	return {
		scale,
		left: anchor.x - applied * (anchor.x - viewport.left),
		top: anchor.y - applied * (anchor.y - viewport.top),
	};
}

/** @param {Viewport} viewport @param {number} dx @param {number} dy @returns {Viewport} */
export function pan(viewport, dx, dy) {
	return { scale: viewport.scale, left: viewport.left + dx, top: viewport.top + dy };
}

/**
 * A viewport with an image point in the middle of the panel.
 *
 * @param {ImagePoint} point @param {Size} panel @param {number} scale
 * @returns {Viewport}
 */
export function centeredOn(point, panel, scale) {
	const corner = { x: point.x + 0.5, y: point.y + 0.5 };
	return {
		scale,
		left: panel.width / 2 - corner.x * scale,
		top: panel.height / 2 - corner.y * scale,
	};
}

/**
 * Where an image point stands in the panel. Image coordinates count from the centre of the
 * top-left pixel, the picture is drawn from its corner: hence the half.
 *
 * @param {Viewport} viewport @param {ImagePoint} point
 * @returns {ScreenPoint}
 */
export function toScreen(viewport, point) {
	return {
		x: viewport.left + (point.x + 0.5) * viewport.scale,
		y: viewport.top + (point.y + 0.5) * viewport.scale,
	};
}

/** @param {Viewport} viewport @param {ScreenPoint} point @returns {ImagePoint} */
export function toImage(viewport, point) {
	return {
		x: (point.x - viewport.left) / viewport.scale - 0.5,
		y: (point.y - viewport.top) / viewport.scale - 0.5,
	};
}
