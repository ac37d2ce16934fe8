// @ts-check
/** A figure of a run: its panels drawn, its files, and the frames behind each point. */

import { html } from 'htm/preact';
import { useMemo } from 'preact/hooks';

import { figureAddress, getFigure, getFrames } from '../../api/evaluations.js';
import { sentenceOf, useResource } from '../../lib/resource.js';
import { navigate } from '../../lib/router.js';
import { reviewAddress } from '../../state/navigation.js';
import { complain } from '../../state/notice.js';
import { Chart } from '../chart.js';
import { Loading } from '../page_frame.js';
import { number } from './cell.js';

/** @import {ChartColour} from '../../lib/chart_colours.js' */
/** @import {FrameQuery, PanelJson, SeriesJson} from '../../api/evaluations.js' */
/** @import {Curve} from '../chart.js' */

/** @typedef {(query: FrameQuery, title: string) => void} Open */

/** Which numbers of the frames stand along x, and what a place there means. @type {{[figure: string]: {field: string, below: boolean}}} */
const BEHIND = {
	precision_distance: { field: 'error_m', below: true },
	error_by_distance: { field: 'distance_m', below: false },
	error_by_parallax: { field: 'parallax_degrees', below: false },
	error_by_size: { field: 'diameter_px', below: false },
	jac: { field: 'predicted_jac', below: true },
};
const COLOURS = /** @type {ChartColour[]} */ (['chart-a', 'chart-b', 'chart-c', 'chart-d', 'chart-e', 'chart-f']);

/** All places of x, once each, in order. @param {SeriesJson[]} series @returns {number[]} */
function places(series) {
	return [...new Set(series.flatMap(({ x }) => x))].sort((a, b) => a - b);
}

/** @param {number[]} values @param {SeriesJson} series @param {Map<number, number>} at @param {number} length @returns {(number | null)[]} */
function spread(values, { x }, at, length) {
	/** @type {(number | null)[]} */
	const row = Array(length).fill(null);
	if (values.length === x.length) x.forEach((place, index) => { row[/** @type {number} */ (at.get(place))] = values[index]; });
	return row;
}

/** The colour of a series: its own, or by the value that it stands for. @param {SeriesJson} series @param {number} index @param {PanelJson} panel */
function colourOf({ color }, index, panel) {
	if (color === null || !panel.color) return COLOURS[index % COLOURS.length];
	const values = panel.series.flatMap((one) => (one.color === null ? [] : [one.color]));
	const [low, high] = [Math.min(...values), Math.max(...values)];
	const share = high > low ? (color - low) / (high - low) : 0;
	return COLOURS[Math.min(COLOURS.length - 1, Math.floor(share * 4))];
}

/** @param {PanelJson} panel @returns {{x: number[], curves: Curve[]}} */
function drawn(panel) {
	const x = places(panel.series);
	const at = new Map(x.map((place, index) => [place, index]));
	const curves = panel.series.map((series, index) => ({
		label: series.label || series.name,
		values: spread(series.y, series, at, x.length),
		low: spread(series.low, series, at, x.length),
		high: spread(series.high, series, at, x.length),
		colour: colourOf(series, index, panel),
		dash: series.kind === 'dashed' ? [8, 5] : undefined,
		points: series.kind === 'points',
	}));
	return { x, curves };
}

/** The nearest series with a group at a place of x. @param {PanelJson} panel @param {number} place @param {number | null} y */
function groupAt(panel, place, y) {
	const near = panel.series.flatMap((series) => {
		if (series.group_id === null) return [];
		return series.x.map((x, index) => ({ group: series.group_id, off: Math.abs(x - place), up: y === null ? 0 : Math.abs(series.y[index] - y) }));
	});
	const closest = Math.min(...near.map(({ off }) => off));
	return near.filter(({ off }) => off === closest).sort((a, b) => a.up - b.up)[0]?.group ?? null;
}

/** The frames between the neighbours of a place. @param {string} name @param {number[]} x @param {number} index @returns {FrameQuery | null} */
function framesAt(name, x, index) {
	const behind = BEHIND[name];
	if (!behind) return null;
	if (behind.below) return { field: behind.field, high: x[index] };
	const between = (/** @type {number} */ a, /** @type {number} */ b) => (x[a] + x[b]) / 2;
	return {
		field: behind.field,
		low: index > 0 ? between(index - 1, index) : null,
		high: index < x.length - 1 ? between(index, index + 1) : null,
	};
}

/** A point that stands for one frame opens its group, one for several lists them. @param {number} evaluation @param {FrameQuery} query @param {string} title @param {Open} open */
async function openBehind(evaluation, query, title, open) {
	try {
		const { items, total } = await getFrames(evaluation, query);
		if (total === 1 && items[0].group_id > 0) navigate(reviewAddress(items[0].group_id, ''));
		else open(query, title);
	} catch (error) {
		complain(sentenceOf(error));
	}
}

/** @param {{evaluation: number, name: string, panel: PanelJson, alone: boolean, open: Open}} props `alone`: the figure's own title says it */
function Panel({ evaluation, name, panel, alone, open }) {
	const { x, curves } = useMemo(() => drawn(panel), [panel]);
	const axis = (/** @type {PanelJson['x']} */ { label, unit }) => (unit ? `${label}, ${unit}` : label);
	/** @param {number} index @param {number | null} y */
	function pick(index, y) {
		const group = groupAt(panel, x[index], y);
		if (group !== null) {
			navigate(reviewAddress(group, ''));
			return;
		}
		const query = framesAt(name, x, index);
		if (query) openBehind(evaluation, query, `${axis(panel.x)} ${number(x[index])}`, open);
	}
	const many = curves.length > 8;
	const mark = panel.marks.find((one) => one.axis === 'x');
	return html`
		<div class="figure__panel">
			${alone || !panel.title ? null : html`<h3>${panel.title}</h3>`}
			<${Chart}
				name=${`${panel.title || axis(panel.y)} against ${axis(panel.x)}: ${many ? `${curves.length} curves` : curves.map(({ label }) => label).join(', ')}`}
				x=${x} curves=${curves} xLabel=${axis(panel.x)} yLabel=${axis(panel.y)} height=${260} marker=${mark?.at ?? null} format=${number} legend=${!many}
				xRange=${panel.x.low !== null && panel.x.high !== null ? [panel.x.low, panel.x.high] : undefined} yRange=${[panel.y.low, panel.y.high]}
				onPick=${pick}
			/>
			${panel.color ? html`<p class="note">Colour: ${axis(panel.color).toLowerCase()}, blue is the smallest</p>` : null}
		</div>
	`;
}

/** @param {{evaluation: number, name: string, open: Open}} props */
export function FigureCard({ evaluation, name, open }) {
	const figure = useResource((signal) => getFigure(evaluation, name, signal), [evaluation, name]);
	const found = figure.value;
	return html`
		<section class="card figure" aria-labelledby=${`figure-${name}`}>
			<h2 id=${`figure-${name}`}>${found?.title ?? name}
				<span class="card__aside buttons">${/** @type {const} */ (['csv', 'json', 'png']).map((ending) => html`<a key=${ending} class="link" href=${figureAddress(evaluation, name, ending)} download=${`${name}.${ending}`}>${ending.toUpperCase()}<span class="hidden-text"> of ${found?.title ?? name}</span></a>`)}</span></h2>
			${figure.error ? html`<p class="form__error" role="alert">${sentenceOf(figure.error)}</p>` : null}
			${!found && !figure.error ? html`<${Loading} what="the figure" />` : null}
			<div class="figure__panels">${(found?.panels ?? []).map((panel, index) => html`<${Panel} key=${index} evaluation=${evaluation} name=${name} panel=${panel} alone=${found?.panels.length === 1} open=${open} />`)}</div>
			${found?.note ? html`<p class="note">${found.note}</p>` : null}
		</section>
	`;
}
