// @ts-check
/** Sizes on screen that drawing and hit testing must agree on, CSS pixels. */

/** Boxes smaller than this show no corners: they would hide the ball. */
export const CORNERS_FROM = 22;

/** Marks have their full size on panels at least this wide. */
const FULL_FROM = 600;
/** And this share of it on the smallest. */
const SMALLEST = 0.5;

/**
 * How large points, lines and words are drawn on a panel: what suits a large panel would hide
 * a small one.
 *
 * @param {number} width of the panel, CSS pixels
 * @returns {number} a share, 1 on a large panel
 */
export function markShare(width) {
	return Math.min(1, Math.max(SMALLEST, Math.sqrt(Math.max(0, width) / FULL_FROM)));
}
