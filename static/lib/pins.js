// @ts-check
/** Notes that stand at a place of a view: lines such as "B 612,330: the ball is behind the post". */

/** @import {PointJson} from '../api/types.js' */

const PIN = /^([A-Z]) (-?\d+),(-?\d+): (.+)$/;

/** @param {string} letter @param {PointJson} at image pixels @param {string} text @returns {string} */
export function pinText(letter, at, text) {
	return `${letter} ${Math.round(at.x)},${Math.round(at.y)}: ${text}`;
}

/**
 * The pins of a view among the lines of a note.
 *
 * @param {string | null} note @param {string} letter
 * @returns {{at: PointJson, text: string}[]}
 */
export function pinsOf(note, letter) {
	return (note ?? '').split('\n').flatMap((line) => {
		const found = PIN.exec(line);
		return found?.[1] === letter
			? [{ at: { x: Number(found[2]), y: Number(found[3]) }, text: found[4] }] : [];
	});
}
