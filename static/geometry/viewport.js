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
 * The part of an image that covers the panel wholly, as much of it as the panel allows.
 *
 * @param {Size} image @param {Size} panel
 * @param {ImagePoint | null} center what should stand in the middle; null: the middle of the image
 * @returns {Viewport}
 */
export function fill(image, panel, center) {
	const scale = Math.max(panel.width / image.width, panel.height / image.height);
	const middle = center ?? { x: image.width / 2 - 0.5, y: image.height / 2 - 0.5 };
	const { left, top } = centeredOn(middle, panel, scale);
	return {
		scale,
		left: clamp(left, panel.width - image.width * scale, 0),
		top: clamp(top, panel.height - image.height * scale, 0),
	};
}

/**
 * The same viewport, `factor` times closer, with `anchor` left where it is.
 *
 * An anchor beside the picture counts as the nearest place of the picture, and no more of the
 * panel becomes empty than was: turning the wheel over a black bar keeps the picture in sight.
 *
 * @param {Viewport} viewport @param {ScreenPoint} anchor @param {number} factor
 * @param {Size} image @param {Size} panel
 * @returns {Viewport} not farther than the whole image
 */
export function zoomAbout(viewport, anchor, factor, image, panel) {
	const scale = Math.min(CLOSEST, Math.max(fit(image, panel).scale, viewport.scale * factor));
	const applied = scale / viewport.scale;
	/** @param {number} start @param {number} place @param {number} size of the image @param {number} room of the panel */
	const along = (start, place, size, room) => {
		const held = clamp(place, start, start + size * viewport.scale);
		const beyond = Math.abs(start - clamp(start, ...range(size * viewport.scale, room)));
		const [low, high] = range(size * scale, room);
		return clamp(held - applied * (held - start), low - beyond, high + beyond);
	};
	return {
		scale,
		left: along(viewport.left, anchor.x, image.width, panel.width),
		top: along(viewport.top, anchor.y, image.height, panel.height),
	};
}

/**
 * The viewport moved, as far as the picture stays in sight: while it just covers the panel it
 * stops at its border, closer up its border may come to the middle of the panel.
 *
 * @param {Viewport} viewport @param {number} dx @param {number} dy
 * @param {Size} image @param {Size} panel
 * @returns {Viewport}
 */
export function pan(viewport, dx, dy, image, panel) {
	const { scale } = viewport;
	const covering = Math.max(panel.width / image.width, panel.height / image.height);
	const slack = clamp(scale / covering - 1, 0, 1) / 2;
	/** @param {number} start @param {number} by @param {number} size of the image @param {number} room of the panel */
	const along = (start, by, size, room) => {
		const [low, high] = range(size * scale, room);
		// What stands farther out already may stay there, or come back.
		return clamp(start + by, Math.min(start, low - slack * room), Math.max(start, high + slack * room));
	};
	return {
		scale,
		left: along(viewport.left, dx, image.width, panel.width),
		top: along(viewport.top, dy, image.height, panel.height),
	};
}

/**
 * A viewport that was made for a panel of another size, or for another image: what stood in the
 * middle stays there, and something of the image is in sight.
 *
 * @param {Viewport} viewport @param {Size} before size of the panel it was made for
 * @param {Size} image @param {Size} panel
 * @returns {Viewport}
 */
export function inPanel(viewport, before, image, panel) {
	const whole = fit(image, panel);
	if (viewport.scale <= whole.scale) return whole;
	/** @param {number} start @param {number} size of the image @param {number} was @param {number} room */
	const along = (start, size, was, room) => (
		clamp(start + (room - was) / 2, room / 2 - size * viewport.scale, room / 2)
	);
	return {
		scale: viewport.scale,
		left: along(viewport.left, image.width, before.width, panel.width),
		top: along(viewport.top, image.height, before.height, panel.height),
	};
}

/** Where a picture may start so that it covers its room, or stands in the middle of it. @param {number} size @param {number} room CSS pixels @returns {[number, number]} */
function range(size, room) {
	return size < room ? [(room - size) / 2, (room - size) / 2] : [room - size, 0];
}

/** The number of a range that is nearest to a value. @param {number} value @param {number} low @param {number} high */
export function clamp(value, low, high) {
	return Math.min(high, Math.max(low, value));
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
