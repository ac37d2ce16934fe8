// @ts-check
/** Days as people mean them: from midnight to midnight where they are. */

/**
 * The beginning of a day, or of one after it, as a moment; what is no day stays as it is.
 *
 * @param {string} day as a field of dates has it, 2026-03-29 @param {number} [later] days
 */
export function beginningOf(day, later = 0) {
	const found = /^(\d{4})-(\d\d)-(\d\d)$/.exec(day);
	if (!found) return day;
	const [year, month, date] = found.slice(1).map(Number);
	const at = new Date(year, month - 1, date + later);
	return Number.isNaN(at.getTime()) ? day : at.toISOString();
}

/** Whether a day is over where the person is. @param {string} day as a field of dates has it, 2026-03-29 @param {number} [now] */
export function isOverHere(day, now = Date.now()) {
	return now >= Date.parse(beginningOf(day, 1));
}
