// @ts-check
/** Where the marks of predictions stand on screen; drawing and the pointer go by the same. */

import { toScreen } from '../geometry/viewport.js';
import { scoreText } from '../lib/format.js';

/** @import {ScreenPoint, Viewport} from '../geometry/viewport.js' */
/** @import {Mark} from '../state/prediction_marks.js' */

/** @typedef {{left: number, top: number, width: number, height: number}} Rect   CSS pixels */
/** @typedef {{mark: Mark, box: Rect, tag: Rect, text: string}} Placed */

/** Brackets stand that far outside of their box. */
const AROUND = 5;
const TAG_HEIGHT = 18;
/** Mean width of a letter of the tag; its text is fitted into what that makes. */
const LETTER = 5.8;
const LONGEST_NAME = 18;
const REACH = 6;

/** @param {Mark} mark @param {boolean} chosen */
function textOf({ name, sure, ...mark }, chosen) {
	const short = name.length > LONGEST_NAME ? `${name.slice(0, LONGEST_NAME - 1)}…` : name;
	return sure || chosen ? `${short} ${scoreText(mark)}` : scoreText(mark);
}

/** @param {Rect} a @param {Rect} b */
function meets(a, b) {
	return a.left < b.left + b.width && b.left < a.left + a.width && a.top < b.top + b.height && b.top < a.top + a.height;
}

/**
 * Where brackets and tags stand on screen; drawing and the pointer go by it.
 *
 * @param {readonly Mark[]} marks @param {Viewport} viewport @param {number} imageWidth pixels of the image
 * @param {number | null} [chosen] id of the selected one
 * @returns {Placed[]}
 */
export function placeMarks(marks, viewport, imageWidth, chosen = null) {
	const right = toScreen(viewport, { x: imageWidth - 0.5, y: 0 }).x;
	/** @type {Placed[]} */
	const placed = [];
	for (const mark of marks) {
		const corner = toScreen(viewport, { x: mark.box[0], y: mark.box[1] });
		const box = {
			left: corner.x - AROUND, top: corner.y - AROUND,
			width: mark.box[2] * viewport.scale + 2 * AROUND, height: mark.box[3] * viewport.scale + 2 * AROUND,
		};
		const text = textOf(mark, mark.id === chosen);
		const width = text.length * LETTER + 10;
		const tag = {
			left: Math.min(box.left + box.width + 2, right - width), width, height: TAG_HEIGHT,
			// What is less sure keeps out of the way of what is not.
			top: mark.sure ? box.top + box.height + 2 : box.top - TAG_HEIGHT - 2,
		};
		// Several sets mean the same ball: their tags stand below each other.
		for (let again = true; again;) {
			const other = placed.find((one) => meets(one.tag, tag));
			again = other !== undefined;
			if (other) tag.top = other.tag.top + (mark.sure ? 1 : -1) * (TAG_HEIGHT + 2);
		}
		placed.push({ mark, box, tag, text });
	}
	return placed;
}

/**
 * The prediction under a place; null where none is.
 *
 * @param {Placed[]} placed @param {ScreenPoint} at
 * @returns {Mark | null}
 */
export function markAt(placed, at) {
	const spot = { left: at.x, top: at.y, width: 0.01, height: 0.01 };
	const tagged = placed.find(({ tag }) => meets(tag, spot));
	if (tagged) return tagged.mark;
	const reach = { left: at.x - REACH, top: at.y - REACH, width: 2 * REACH, height: 2 * REACH };
	const near = placed.filter(({ box }) => meets(box, reach));
	return near.sort((a, b) => away(a.box, at) - away(b.box, at))[0]?.mark ?? null;
}

/** @param {Rect} box @param {ScreenPoint} at */
function away({ left, top, width, height }, { x, y }) {
	return Math.hypot(left + width / 2 - x, top + height / 2 - y);
}
