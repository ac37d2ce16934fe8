// @ts-check
/** Why a group is rejected, or one of its views left out. */

/** @import {LeftOutJson} from '../api/types.js' */

/** In the order of their digits. */
export const REASONS = [
	{ name: 'bad_field_lines', label: 'Bad field lines' },
	{ name: 'sides_confused', label: 'Sides swapped' },
	{ name: 'not_same_instant', label: 'Not the same instant' },
	{ name: 'ball_not_visible', label: 'Ball not visible' },
	{ name: 'bad_calibration', label: 'Bad calibration' },
	{ name: 'duplicate_view', label: 'Duplicate view' },
	{ name: 'other', label: 'Other…' },
];

/**
 * Why a view was left out, as part of a sentence; '' where nobody said.
 *
 * @param {LeftOutJson | null | undefined} why
 */
export function reasonText(why) {
	if (!why) return '';
	const label = REASONS.find(({ name }) => name === why.reason)?.label.toLowerCase() ?? why.reason;
	if (why.reason === 'other') return why.note ?? '';
	return why.note ? `${label} (${why.note})` : label;
}

/** "left out: not the same instant". @param {LeftOutJson | null | undefined} why */
export function leftOutText(why) {
	const text = reasonText(why);
	return text ? `left out: ${text}` : 'left out';
}
