// @ts-check
/** The colours of a figure: of curves without order, and the steps of an ordered scale. */

/** @import {ChartColour} from '../../lib/chart_colours.js' */
/** @import {PanelJson, SeriesJson} from '../../api/evaluations.js' */

const COLOURS = /** @type {ChartColour[]} */ (['chart-a', 'chart-b', 'chart-c', 'chart-d', 'chart-e', 'chart-f']);
/** From cold to warm: blue, green, yellow, orange. */
const SCALE = /** @type {ChartColour[]} */ (['chart-a', 'chart-c', 'chart-b', 'chart-e']);

/** @param {PanelJson} panel @returns {[number, number] | null} */
function rangeOf(panel) {
	const values = panel.series.flatMap((one) => (one.color === null ? [] : [one.color]));
	return values.length ? [Math.min(...values), Math.max(...values)] : null;
}

/** The colour of a series: its own, or by the value that it stands for. @param {SeriesJson} series @param {number} index @param {PanelJson} panel @returns {ChartColour} */
export function colourOf({ color }, index, panel) {
	const range = panel.color ? rangeOf(panel) : null;
	if (color === null || !range) return COLOURS[index % COLOURS.length];
	const [low, high] = range;
	const share = high > low ? (color - low) / (high - low) : 0;
	return SCALE[Math.min(SCALE.length - 1, Math.floor(share * SCALE.length))];
}

/** What each step of the scale stands for, the smallest values first. @param {PanelJson} panel @returns {{colour: ChartColour, low: number, high: number}[]} */
export function stepsOf(panel) {
	const range = rangeOf(panel);
	if (!range) return [];
	const [low, high] = range;
	if (high === low) return [{ colour: SCALE[0], low, high }];
	const step = (high - low) / SCALE.length;
	return SCALE.map((colour, index) => ({ colour, low: low + index * step, high: low + (index + 1) * step }));
}
