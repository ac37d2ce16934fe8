// @ts-check
/** Markings in plain words: the names are the datasets', and say "Circle right" of the arc at the right penalty area. */

const AREAS = /** @type {Record<string, string>} */ ({ Big: 'penalty area', Small: 'goal area' });
const SIDES = /** @type {Record<string, string>} */ ({ top: 'far side', bottom: 'near side', main: 'front line' });
const SINGLE = /** @type {Record<string, string>} */ ({
	'Circle central': 'centre circle',
	'Circle left': 'arc of the left penalty area',
	'Circle right': 'arc of the right penalty area',
	'Middle line': 'halfway line',
	'Side line bottom': 'near touchline',
	'Side line top': 'far touchline',
	'Side line left': 'left goal line',
	'Side line right': 'right goal line',
});

/**
 * What a marking is, as people say it; near and far are seen from the main camera.
 *
 * @param {string} marking "Big rect. left main"
 * @returns {string} "left penalty area, front line"; the name itself where nothing is known of it
 */
export function plainMarking(marking) {
	const area = /^(Big|Small) rect\. (left|right) (top|bottom|main)$/.exec(marking);
	if (area) return `${area[2]} ${AREAS[area[1]]}, ${SIDES[area[3]]}`;
	const goal = /^Goal (left|right) (?:post (left|right)|(crossbar))$/.exec(marking);
	if (goal) return `${goal[1]} goal, ${goal[3] ?? `${goal[2]} post`}`;
	return SINGLE[marking] ?? marking;
}
