// @ts-check
/** Which point of a figure somebody clicked at, and what stands behind it. */

import { number } from './cell.js';

/** @import {AxisJson, PanelJson, SeriesJson} from '../../api/evaluations.js' */

/** @typedef {{series: SeriesJson, place: number}} Point */

/** How far beside the clicked place a point may stand, as a share of the axis. */
const REACH = 0.015;

/** @param {AxisJson} axis */
export function axisText({ label, unit }) {
	return unit ? `${label}, ${unit}` : label;
}

/** Whether clicks on it lead anywhere. @param {SeriesJson} series */
export function opens({ group_id, frames }) {
	return group_id !== null || (frames ?? []).length > 0;
}

/** @param {number[]} values @param {number | null} low @param {number | null} high */
function spanOf(values, low, high) {
	const [from, to] = [low ?? Math.min(...values), high ?? Math.max(...values)];
	return to > from ? to - from : 1;
}

/** The places of a series that a click may mean. @param {SeriesJson} series @param {number} at @param {number} span */
function candidates(series, at, span) {
	const off = series.x.map((x) => Math.abs(x - at) / span);
	const nearest = Math.min(...off);
	const reach = series.kind === 'points' ? Math.max(nearest, REACH) : nearest;
	return off.flatMap((one, place) => (one <= reach ? [{ series, place, off: one }] : []));
}

/**
 * The point nearest to a place of x, and to a height where one is known. A curve that opens nothing
 * keeps its clicks: they never open what stands behind another.
 *
 * @param {PanelJson} panel @param {number} at @param {number | null} y @returns {Point | null}
 */
export function pointAt(panel, at, y) {
	const every = panel.series.flatMap((series) => series.x.map((x, place) => ({ x, y: series.y[place] })));
	if (every.length === 0) return null;
	const width = spanOf(every.map((one) => one.x), panel.x.low, panel.x.high);
	const height = spanOf(every.map((one) => one.y), panel.y.low, panel.y.high);
	const near = panel.series.flatMap((series) => candidates(series, at, width)).map((one) => ({
		...one, far: Math.hypot(one.off, y === null ? 0 : (one.series.y[one.place] - y) / height),
	}));
	const closest = near.reduce((best, one) => (one.far < best.far ? one : best));
	return { series: closest.series, place: closest.place };
}

/** What the frames behind a point are: a bin by its ends, others by the curve and the place. @param {PanelJson} panel @param {SeriesJson} series @param {number} place */
export function behindText({ x }, { label, name, x: places, count, frames }, place) {
	const unit = x.unit ? ` ${x.unit}` : '';
	const behind = frames?.[place];
	if (name === 'median' && behind) {
		const bin = behind.high === null ? `${behind.low}${unit} and more` : `${behind.low} to ${behind.high}${unit}`;
		return `${x.label} ${bin}, ${count[place]} with an error`;
	}
	return `${label || name} · ${x.label} ${number(places[place])}${unit}`;
}
