// @ts-check
/** Sizes on screen that drawing and hit testing must agree on, CSS pixels. */

/** Boxes smaller than this show no corners: they would hide the ball. */
export const CORNERS_FROM = 22;
