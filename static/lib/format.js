// @ts-check
/** Numbers and times as people read them. A missing number is a dash, never zero. */

const NONE = '–';
const MINUS = '−';
/** No picture is as large, pixels. */
const BEYOND = 20_000;

/**
 * @param {number | null | undefined} value
 * @param {number} digits after the point
 * @param {string} [unit]
 * @returns {string}
 */
export function fixed(value, digits, unit = '') {
	if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
	const text = Math.abs(value).toFixed(digits);
	const sign = value < 0 && Number(text) !== 0 ? MINUS : '';
	return `${sign}${text}${unit}`;
}

/**
 * Pixels in four characters: 7.3, 211, 1.7k, and ">20k" beyond every picture.
 *
 * @param {number | null | undefined} value
 * @returns {string}
 */
export function pixels(value) {
	const size = Math.abs(value ?? 0);
	if (size >= BEYOND) return '>20k';
	if (size >= 999.5) return fixed((value ?? 0) / 1000, size >= 9950 ? 0 : 1, 'k');
	return fixed(value, size >= 99.95 ? 0 : 1);
}

/** Pixels with their unit, for sentences: "7.3 px", "1,720 px", ">20,000 px". @param {number | null | undefined} value */
export function pixelText(value) {
	const size = Math.abs(value ?? 0);
	if (size >= BEYOND) return `>${count(BEYOND)} px`;
	if (size >= 999.5) return `${(value ?? 0) < 0 ? MINUS : ''}${count(Math.round(size))} px`;
	return fixed(value, size >= 99.95 ? 0 : 1, ' px');
}

/** An angle: "44.5°". @param {number | null | undefined} value */
export function degrees(value) {
	return fixed(value, 1, '°');
}

/** A place or a length on the pitch: "−34.76 m". @param {number | null | undefined} value */
export function metres(value) {
	return fixed(value, 2, ' m');
}

/** Per cent in four characters: 0.06, 14.3, 113. @param {number | null | undefined} value */
export function percent(value) {
	const size = Math.abs(value ?? 0);
	return fixed(value, size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2);
}

/** Beyond this many times nobody compares any more. */
const MOST_TIMES = 10;

/**
 * A share without its sign, as per cent in few characters: 0.352 -> "35 %", 0.041 -> "4.1 %".
 *
 * @param {number} value
 */
export function sharePercent(value) {
	const size = Math.abs(100 * value);
	if (size > 100 * MOST_TIMES) return `over ${MOST_TIMES}×`;
	return `${size.toFixed(size >= 9.95 ? 0 : 1)} %`;
}

/**
 * A margin: how far a value is from its threshold, as a share of the threshold; positive when it is met.
 *
 * @param {number | null | undefined} value 0.352
 * @returns {string} "+35 %"
 */
export function marginText(value) {
	if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
	const text = sharePercent(value);
	if (text === '0.0 %') return text;
	const sign = value < 0 ? MINUS : '+';
	return text.startsWith('over ') ? `${value < 0 ? '<' : '>'}${sign}${text.slice(5)}` : `${sign}${text}`;
}

/** 12764 -> "12,764". @param {number} value */
export function count(value) {
	return value.toLocaleString('en-GB');
}

/** 1, "group" -> "1 group"; 12764 -> "12,764 groups". @param {number} n @param {string} noun */
export function plural(n, noun) {
	return `${count(n)} ${noun}${n === 1 ? '' : 's'}`;
}

/** 1, "balls" -> "1 ball"; 1, "pictures turned by EXIF" -> "1 picture turned by EXIF". @param {number} n @param {string} names of several, as a report counts them */
export function counted(n, names) {
	return `${count(n)} ${n === 1 ? words(names).replace(/(?<=x|ss)es\b|s\b/, '') : words(names)}`;
}

/** "bad_field_lines" -> "bad field lines". @param {string} name */
export function words(name) {
	return name.replaceAll('_', ' ');
}

/** @param {string} text */
export function capital(text) {
	return text.charAt(0).toUpperCase() + text.slice(1);
}

/**
 * @param {number} then milliseconds
 * @param {number} now milliseconds
 * @returns {string} "just now", "12 s ago", "3 min ago", "2 h ago", "4 d ago"
 */
export function ago(then, now) {
	const seconds = Math.max(0, Math.round((now - then) / 1000));
	if (seconds < 2) return 'just now';
	if (seconds < 60) return `${seconds} s ago`;
	if (seconds < 3600) return `${Math.floor(seconds / 60)} min ago`;
	if (seconds < 86400) return `${Math.floor(seconds / 3600)} h ago`;
	return `${Math.floor(seconds / 86400)} d ago`;
}

/** How sure a detector is. @param {{score: number, scored: boolean}} prediction */
export function scoreText({ score, scored }) {
	return scored ? score.toFixed(2) : 'no score';
}
