// @ts-check
/** Sizes of pitches as people read them. */

/** @param {{length: number, width: number}} size metres */
export function pitchSize({ length, width }) {
	return `${trimmed(length)} × ${trimmed(width)} m`;
}

/**
 * What lines show of a pitch, each number with its standard deviation.
 *
 * @param {{length: number | null, width: number | null, length_sigma_m: number | null, width_sigma_m: number | null, frames: number} | null} estimate null: not computed yet
 */
export function shownSize(estimate) {
	if (!estimate) return 'not estimated yet';
	const length = part('length', estimate.length, estimate.length_sigma_m);
	return `${length}, ${part('width', estimate.width, estimate.width_sigma_m)}`;
}

/** @param {string} name @param {number | null} metres @param {number | null} sigma */
function part(name, metres, sigma) {
	if (metres === null || sigma === null) return `${name} unknown`;
	return `${name} ${metres.toFixed(1)} ± ${sigma.toFixed(1)} m`;
}

/** @param {number} metres */
function trimmed(metres) {
	return String(Math.round(metres * 10) / 10);
}
