// @ts-check
/** The size of images as people write it. */

const SMALLEST = 2;
const LARGEST = 16384;

/**
 * 1280x720, 1280 × 720 or 1280, 720; nothing is null.
 *
 * @param {string} text @param {string} what whose size it is, to say what is wrong
 * @returns {{size: [number, number] | null, problem: string}}
 */
export function readSize(text, what) {
	if (text.trim() === '') return { size: null, problem: '' };
	const found = /^\s*(\d{1,6})\s*[x×X*,]\s*(\d{1,6})\s*$/.exec(text);
	if (!found) return { size: null, problem: `${what}: write width x height, for example 1280x720` };
	const [width, height] = [Number(found[1]), Number(found[2])];
	const right = [width, height].every((side) => side >= SMALLEST && side <= LARGEST);
	if (!right) return { size: null, problem: `${what}: each side is ${SMALLEST} to ${LARGEST.toLocaleString('en-GB')} pixels` };
	return { size: [width, height], problem: '' };
}
