// @ts-check
/** How the pictures of a group share the screen: the arrangement that shows most of them. */

import { fit } from './viewport.js';

/** @import {Size} from './viewport.js' */
/** @typedef {[row: number, column: number, tall: number, wide: number]} Area   in tracks, from 0 */
/**
 * @typedef {object} PanelGrid a grid of tracks, and the place of every picture in it
 * @property {number[]} columns shares of the width
 * @property {number[]} rows shares of the height
 * @property {Area[]} areas of each picture
 * @property {number} score sum of the widths that the pictures have when each is shown whole, the
 *   main camera's counted more: a sum of areas would make the others vanish
 */
/**
 * @typedef {object} Screen the views and the strip with ball, lines and pitch
 * @property {'below' | 'beside'} side where the strip stands
 * @property {number} strip its height, or its width beside the views, CSS pixels
 * @property {number} score as of the best grid
 */

/** Between panels, and around them the line of one pixel, CSS pixels. */
export const GAP = 8;
/** Shares of the room that the first picture may have. */
const SPLITS = Array.from({ length: 15 }, (_, i) => 0.4 + 0.03 * i);
/** The main camera is at least this much wider than any other picture. */
const LARGER = 1.25;
const MAIN_COUNTS = 1.4;

/**
 * The arrangement that shows most of the pictures. Two are equally large, of more the main
 * camera's is larger.
 *
 * @param {Size[]} images sizes of the images, the main camera's first
 * @param {Size} room CSS pixels
 * @param {boolean} equal whether every view is as large as the main camera's
 * @returns {PanelGrid}
 */
export function panelGrid(images, room, equal) {
	const plain = images.length <= 2 || equal || images.length > 6;
	const grids = plain ? evenGrids(images.length) : mainGrids(images.length);
	const scored = grids.map((grid) => scoredGrid(grid, images, room, plain));
	const large = plain ? scored : scored.filter(({ widths }) => widths.slice(1).every((width) => widths[0] >= LARGER * width));
	const candidates = large.length > 0 ? large : scored;
	return candidates.reduce((best, one) => (one.score > best.score ? one : best));
}

/** @typedef {{columns: number[], rows: number[], areas: Area[]}} Tracks */

/** @param {number} n @returns {Tracks[]} */
function evenGrids(n) {
	const grids = [];
	for (let across = 1; across <= Math.max(1, n); across++) {
		const down = Math.max(1, Math.ceil(n / across));
		const areas = Array.from({ length: n }, (_, i) => area(Math.floor(i / across), i % across));
		grids.push({ columns: shares(across), rows: shares(down), areas });
	}
	return grids;
}

/** The main camera large: the others beside it, below it, or on two of its sides. @param {number} n @returns {Tracks[]} */
function mainGrids(n) {
	const others = n - 1;
	/** @type {Tracks[]} */
	const grids = [];
	for (const split of SPLITS) {
		for (let across = 1; across <= others; across++) {
			const down = Math.ceil(others / across);
			if (across * (down - 1) >= others || across * down - others > 1) continue;
			const rest = Array.from({ length: others }, (_, i) => [Math.floor(i / across), i % across]);
			grids.push({
				columns: [split, ...shares(across).map((share) => share * (1 - split))], rows: shares(down),
				areas: [area(0, 0, down, 1), ...rest.map(([row, column]) => area(row, column + 1))],
			}, {
				columns: shares(across), rows: [split, ...shares(down).map((share) => share * (1 - split))],
				areas: [area(0, 0, 1, across), ...rest.map(([row, column]) => area(row + 1, column))],
			});
		}
	}
	if (others >= 4) {
		grids.push({
			columns: shares(3), rows: shares(3),
			areas: [area(0, 0, 2, 2), area(0, 2), area(1, 2), area(2, 0), area(2, 1), area(2, 2)].slice(0, n),
		});
	}
	return grids;
}

/** @param {number} n @returns {number[]} */
function shares(n) {
	return Array.from({ length: n }, () => 1 / n);
}

/** @param {number} row @param {number} column @param {number} [tall] @param {number} [wide] @returns {Area} */
function area(row, column, tall = 1, wide = 1) {
	return [row, column, tall, wide];
}

/** @param {Tracks} grid @param {Size[]} images @param {Size} room @param {boolean} plain */
function scoredGrid(grid, images, room, plain) {
	const widths = images.map((image, i) => image.width * Math.max(0, fit(image, panelSize(grid, grid.areas[i], room)).scale));
	const sum = widths.reduce((all, width) => all + width, 0);
	return { ...grid, widths, score: plain ? sum : sum + (MAIN_COUNTS - 1) * widths[0] };
}

/**
 * Size of the panel of an area, its border taken off.
 *
 * @param {Tracks} grid @param {Area} area @param {Size} room CSS pixels
 * @returns {Size}
 */
export function panelSize({ columns, rows }, [row, column, tall, wide], room) {
	return { width: along(columns, column, wide, room.width) - 2, height: along(rows, row, tall, room.height) - 2 };
}

/** @param {number[]} tracks shares @param {number} first @param {number} count @param {number} room */
function along(tracks, first, count, room) {
	let [taken, whole] = [0, 0];
	for (let i = 0; i < tracks.length; i++) {
		whole += tracks[i];
		if (i >= first && i < first + count) taken += tracks[i];
	}
	return ((room - GAP * (tracks.length - 1)) * taken) / whole + GAP * (count - 1);
}

/** The strip is this high at least, and less on low screens. */
const LOWEST = { height: 276, low: 216, below: 720 };
/** Beside the views it needs the width of a line with its picture; folded, that of the pitch's numbers. */
const NARROWEST = 288;
const FOLDED = { height: 120, width: 200 };
/** Two wide pictures one above the other leave room at their side; more do not. */
const BESIDE_UP_TO = 2;
/** Height of the strip at most, as a share. */
const HIGHEST = 0.46;
/** Picture that is given up for a strip with more room, as a share. */
const GIVEN_UP = 0.015;
const STEP = 16;

/**
 * Where the strip stands so that the pictures are largest.
 *
 * @param {Size[]} images @param {Size} room of views and strip together, CSS pixels
 * @param {{equal: boolean, beside: boolean, folded: boolean}} how equal: all views equally large;
 *   beside: the strip may stand beside the views; folded: it shows the least
 * @returns {Screen}
 */
export function arrangeScreen(images, room, { equal, beside, folded }) {
	const lowest = folded ? FOLDED.height : room.height < LOWEST.below ? LOWEST.low : LOWEST.height;
	const highest = folded ? lowest : Math.max(lowest, HIGHEST * room.height);
	/** @type {Screen[]} */
	const screens = [];
	for (let strip = lowest; strip <= highest; strip += STEP) {
		const left = { width: room.width, height: room.height - strip - GAP };
		screens.push({ side: 'below', strip, score: panelGrid(images, left, equal).score });
	}
	const stands = beside && images.length > 1 && images.length <= BESIDE_UP_TO;
	for (let strip = folded ? FOLDED.width : NARROWEST; stands && strip <= room.width / 2; strip += STEP) {
		const left = { width: room.width - strip - GAP, height: room.height };
		screens.push({ side: 'beside', strip, score: panelGrid(images, left, equal).score });
	}
	const most = Math.max(...screens.map(({ score }) => score));
	const good = screens.filter(({ score }) => score >= (1 - GIVEN_UP) * most);
	return good.reduce((best, one) => (one.strip > best.strip ? one : best));
}

/** @param {PanelGrid} grid @param {number} i @returns {string} the place of a picture, as CSS `grid-area` writes it */
export function gridArea({ areas }, i) {
	const [row, column, tall, wide] = areas[i];
	return `${row + 1} / ${column + 1} / ${row + 1 + tall} / ${column + 1 + wide}`;
}

/** @param {number[]} tracks shares @returns {string} as CSS `grid-template-columns` writes them */
export function gridTracks(tracks) {
	return tracks.map((share) => `minmax(0, ${share.toFixed(4)}fr)`).join(' ');
}
