// @ts-check
/** What the query box offers while one types: fields, operators and values. */

/** @typedef {{text: string, label: string, hint: string}} Offer   `text` replaces the word */
/** @typedef {{from: number, to: number, offers: Offer[]}} Completion */
/** @typedef {{[field: string]: string[]}} Facets   values that a dataset has: split, match, reviewer */

const NUMBERS = /** @type {{[field: string]: string}} */ ({
	jac: 'smallest JaC of the views, 0 to 1', agreement: 'least agreement of a camera with its paint, 0 to 1',
	error: 'ball reprojection error, px', error_percent: 'the same, % of the diagonal', sigma: 'uncertainty of the ball, m',
	parallax: 'largest angle between rays, °', size_ratio: 'box against expected diameter',
	height: 'ball above the grass, m', distance: 'from the first view to the ball, m', box: 'diameter of the ball’s box, px',
	x: 'ball along the pitch, m', y: 'ball across the pitch, m', margin: 'how far the deciding gate is from its threshold: 0.1 is 10 % of it, below 0 fails', value: 'the margin without its sign: small where a small mistake decides',
	views: 'how many views', number: 'place in the dataset',
});
const FINDINGS = [
	'any', 'none', 'wrong_label', 'sides_swapped', 'visible_not_annotated', 'bad_point', 'under_constrained',
	'view_disagrees', 'views_contradict', 'not_synchronous', 'ball_size', 'low_parallax', 'high_uncertainty', 'implausible_ball',
	'implausible_camera', 'picture_geometry', 'paint_disagrees', 'no_paint', 'several_balls', 'upstream_changed', 'pitch_size',
];
const GATES = ['none', 'calibratable', 'jac', 'agreement', 'two_views', 'ball', 'baseline', 'reprojection', 'parallax', 'sigma', 'chi_square'];
const SORTS = ['value', 'newest', 'sigma', 'jac', 'agreement', 'error', 'error_percent', 'parallax', 'margin', 'ratio', 'height', 'distance', 'box', 'views', 'findings', 'gate', 'status', 'split', 'reviewer', 'label', 'number'];
const VALUES = /** @type {{[field: string]: string[]}} */ ({
	status: ['unreviewed', 'accepted', 'rejected', 'deferred'],
	finding: FINDINGS,
	gate: GATES,
	reason: ['bad_field_lines', 'sides_confused', 'not_same_instant', 'ball_not_visible', 'bad_calibration', 'duplicate_view', 'other'],
	sort: SORTS.flatMap((name) => [name, `${name}-desc`]),
	stale: ['yes', 'no'], solved: ['yes', 'no'], passes: ['yes', 'no'], fixed: ['yes', 'no'],
	pictures: ['none', 'any', 'all'], split: [], match: [], reviewer: [], view: [], label: [], id: [],
});
const HINTS = /** @type {{[field: string]: string}} */ ({
	status: 'verdict', finding: 'what was noticed', gate: 'first failing gate', reason: 'why rejected',
	sort: 'order of the rows', stale: 'changed after its verdict', solved: 'has numbers', passes: 'every gate',
	fixed: 'edited before it was accepted', split: 'train or test', match: 'part of the match’s name',
	reviewer: 'who decided', view: 'key of a view, or how many', label: 'part of the label',
	pictures: 'whether views have a picture', id: 'groups one by one: id:12,15,19',
});
const MOST = 14;

/**
 * What may stand at the caret.
 *
 * @param {string} text @param {number} caret @param {Facets} facets
 * @returns {Completion}
 */
export function complete(text, caret, facets) {
	const before = text.slice(0, caret);
	// A word goes back to the last space outside quotes.
	const word = /(?:[^\s"]|"[^"]*"?)*$/.exec(before)?.[0] ?? '';
	const from = caret - word.length;
	const to = caret + (/^[^\s"]*/.exec(text.slice(caret))?.[0].length ?? 0);
	const minus = word.startsWith('-') ? '-' : '';
	const found = /^([a-z_]+):(.*)$/.exec(word.slice(minus.length));
	const offers = found ? valueOffers(minus, found[1], found[2], facets) : fieldOffers(minus, word.slice(minus.length));
	return { from, to, offers: offers.slice(0, MOST) };
}

/** @param {string} minus @param {string} start @returns {Offer[]} */
function fieldOffers(minus, start) {
	const texts = Object.keys(VALUES).map((field) => ({ text: `${minus}${field}:`, label: `${minus}${field}:`, hint: HINTS[field] }));
	const numbers = minus ? [] : Object.entries(NUMBERS).flatMap(([field, hint]) => [
		{ text: `${field}<`, label: `${field}<`, hint }, { text: `${field}>`, label: `${field}>`, hint },
	]);
	return [...texts, ...numbers].filter(({ text }) => text.startsWith(minus + start) && text !== start);
}

/** @param {string} minus @param {string} field @param {string} start @param {Facets} facets @returns {Offer[]} */
function valueOffers(minus, field, start, facets) {
	const known = facets[field] ?? VALUES[field] ?? (field in NUMBERS ? ['none'] : []);
	const comma = start.lastIndexOf(',') + 1;
	const [chosen, last] = [start.slice(0, comma), start.slice(comma).replaceAll('"', '').toLowerCase()];
	return known
		.filter((value) => value.toLowerCase().includes(last) && value !== start)
		.sort((a, b) => Number(!a.toLowerCase().startsWith(last)) - Number(!b.toLowerCase().startsWith(last)))
		.map((value) => {
			const quoted = /[\s"]/.test(value) ? `"${value}"` : value;
			return { text: `${minus}${field}:${chosen}${quoted} `, label: value, hint: '' };
		});
}
