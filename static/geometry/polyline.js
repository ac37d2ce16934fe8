// @ts-check
/** Polylines in an image: nearest place, length, and the band beside them. */

/** @import {ImagePoint} from './camera.js' */
/** @typedef {{width: number, height: number}} Size */
/** @typedef {{point: ImagePoint, distance: number, along: number, side: number}} Nearest */

/**
 * The place of a polyline closest to a point.
 *
 * @param {ImagePoint[]} polyline
 * @param {ImagePoint} point
 * @returns {Nearest | null} `along` in pixels from the start; `side` the distance with its sign,
 *   positive to the right of the direction of travel. null for an empty polyline.
 */
export function nearestOn(polyline, point) {
	/** @type {Nearest | null} */
	let best = null;
	let start = 0;
	for (let i = 0; i + 1 < polyline.length; i++) {
		const [a, b] = [polyline[i], polyline[i + 1]];
		const [dx, dy] = [b.x - a.x, b.y - a.y];
		const length = Math.hypot(dx, dy);
		if (length === 0) continue;
		const raw = ((point.x - a.x) * dx + (point.y - a.y) * dy) / (length * length);
		const t = Math.min(1, Math.max(0, raw));
		const on = { x: a.x + t * dx, y: a.y + t * dy };
		const distance = Math.hypot(point.x - on.x, point.y - on.y);
		if (!best || distance < best.distance) {
			const turn = dx * (point.y - a.y) - dy * (point.x - a.x);
			best = { point: on, distance, along: start + t * length, side: turn < 0 ? -distance : distance };
		}
		start += length;
	}
	if (!best && polyline.length > 0) {
		const distance = Math.hypot(point.x - polyline[0].x, point.y - polyline[0].y);
		best = { point: polyline[0], distance, along: 0, side: distance };
	}
	return best;
}

/** As the server rounds what is drawn, pixels. */
const ROUNDED = 1e-3;

/**
 * A clipped polyline as it is seen: cut where it leaves the image and comes back.
 *
 * The server joins what is inside into one polyline, because JaC measures it so (the public
 * evaluator does); nothing is painted along the border between the two crossings, though.
 * Markings are sampled finely, so two neighbours on the border are always such crossings.
 *
 * @param {ImagePoint[]} polyline clipped at the image border
 * @param {Size} image
 * @returns {ImagePoint[][]} pieces of two points or more
 */
export function piecesOf(polyline, { width, height }) {
	/** @param {ImagePoint} point */
	const onBorder = ({ x, y }) => x <= ROUNDED || y <= ROUNDED || x >= width - 1 - ROUNDED || y >= height - 1 - ROUNDED;
	const pieces = [];
	/** @type {ImagePoint[]} */
	let piece = [];
	polyline.forEach((point, i) => {
		if (i > 0 && polyline.length > 2 && onBorder(point) && onBorder(polyline[i - 1])) {
			pieces.push(piece);
			piece = [];
		}
		piece.push(point);
	});
	pieces.push(piece);
	return pieces.filter((one) => one.length > 1);
}

/** @param {ImagePoint[]} polyline @returns {number} pixels */
export function lengthOf(polyline) {
	let length = 0;
	for (let i = 0; i + 1 < polyline.length; i++) {
		length += Math.hypot(polyline[i + 1].x - polyline[i].x, polyline[i + 1].y - polyline[i].y);
	}
	return length;
}

/**
 * Places at even distances along a polyline, each with the normal that points to its right.
 *
 * @param {ImagePoint[]} polyline
 * @param {number} count at least 2
 * @returns {{point: ImagePoint, normal: ImagePoint}[]}
 */
function frames(polyline, count) {
	const total = lengthOf(polyline);
	if (total === 0) return [];
	const result = [];
	let index = 0;
	let start = 0;
	let length = Math.hypot(polyline[1].x - polyline[0].x, polyline[1].y - polyline[0].y);
	for (let i = 0; i < count; i++) {
		const target = (total * i) / (count - 1);
		while (start + length < target && index + 2 < polyline.length) {
			start += length;
			index += 1;
			const [a, b] = [polyline[index], polyline[index + 1]];
			length = Math.hypot(b.x - a.x, b.y - a.y);
		}
		const [a, b] = [polyline[index], polyline[index + 1]];
		const safe = length || 1;
		const t = Math.min(1, (target - start) / safe);
		result.push({
			point: { x: a.x + t * (b.x - a.x), y: a.y + t * (b.y - a.y) },
			normal: { x: -(b.y - a.y) / safe, y: (b.x - a.x) / safe },
		});
	}
	return result;
}

/**
 * As `frames`, over pieces that are looked at as one: each has its share of the places.
 *
 * @param {ImagePoint[][]} pieces
 * @param {number} count at least 2
 * @returns {{point: ImagePoint, normal: ImagePoint}[]}
 */
export function framesOf(pieces, count) {
	const total = pieces.reduce((sum, piece) => sum + lengthOf(piece), 0);
	if (total === 0) return [];
	let [before, taken] = [0, 0];
	return pieces.flatMap((piece) => {
		before += lengthOf(piece);
		const share = Math.round((count * before) / total) - taken;
		taken += share;
		return share > 1 ? frames(piece, share) : frames(piece, 2).slice(0, share);
	});
}

/**
 * As `nearestOn`, over pieces: `along` counts from the start of the first.
 *
 * @param {ImagePoint[][]} pieces @param {ImagePoint} point
 * @returns {Nearest | null}
 */
export function nearestOfPieces(pieces, point) {
	/** @type {Nearest | null} */
	let best = null;
	let start = 0;
	for (const piece of pieces) {
		const near = nearestOn(piece, point);
		if (near && (!best || near.distance < best.distance)) best = { ...near, along: start + near.along };
		start += lengthOf(piece);
	}
	return best;
}
