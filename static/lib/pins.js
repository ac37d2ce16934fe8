// @ts-check
/** Notes of verdicts that stand at a place of a view, as they were written before comments had a place: lines such as "B 612,330: the ball is behind the post". */

/** @import {PointJson} from '../api/types.js' */

const PIN = /^([A-Z]) (-?\d+),(-?\d+): (.+)$/;

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
