// @ts-check
/** A figure of a run: its panels drawn, its files, and the frames behind each point. */

import { html } from 'htm/preact';
import { useMemo } from 'preact/hooks';

import { figureAddress, getFigure, getFrames } from '../../api/evaluations.js';
import { sentenceOf } from '../../api/problem.js';
import { useResource } from '../../lib/resource.js';
import { navigate } from '../../lib/router.js';
import { reviewAddress } from '../../state/navigation.js';
import { complain } from '../../state/notice.js';
import { Chart } from '../chart.js';
import { Loading } from '../page_frame.js';
import { number } from './cell.js';
import { axisText, behindText, opens, pointAt } from './figure_points.js';
import { colourOf, stepsOf } from './figure_scale.js';

/** @import {FrameQuery, PanelJson, SeriesJson} from '../../api/evaluations.js' */
/** @import {Curve} from '../chart.js' */

/** @typedef {(query: FrameQuery, title: string) => void} Open */

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

/** What the colours of the curves mean. @param {{panel: PanelJson}} props */
function ScaleLegend({ panel }) {
	return html`
		<p class="chart__legend">
			<span>${panel.color?.label}</span>
			${stepsOf(panel).map(({ colour, low, high }) => html`<span key=${colour}><svg class="chart__swatch" viewBox="0 0 22 8" aria-hidden="true" data-colour=${colour}><path d="M0 4h22" /></svg>${number(low)} to ${number(high)}${panel.color?.unit ? ` ${panel.color.unit}` : ''}</span>`)}
		</p>
	`;
}

/** @param {{evaluation: number, panel: PanelJson, alone: boolean, open: Open}} props `alone`: the figure's own title says it */
function Panel({ evaluation, panel, alone, open }) {
	const { x, curves } = useMemo(() => drawn(panel), [panel]);
	/** @param {number} index @param {number | null} y */
	function pick(index, y) {
		const point = pointAt(panel, x[index], y);
		if (!point) return;
		const { series, place } = point;
		if (series.group_id !== null) navigate(reviewAddress(series.group_id, ''));
		else if (series.frames?.[place]) openBehind(evaluation, series.frames[place], behindText(panel, series, place), open);
	}
	const many = curves.length > 8;
	const mark = panel.marks.find((one) => one.axis === 'x');
	return html`
		<div class="figure__panel">
			${alone || !panel.title ? null : html`<h3>${panel.title}</h3>`}
			<${Chart}
				name=${`${panel.title || axisText(panel.y)} against ${axisText(panel.x)}: ${many ? `${curves.length} curves` : curves.map(({ label }) => label).join(', ')}`}
				x=${x} curves=${curves} xLabel=${axisText(panel.x)} yLabel=${axisText(panel.y)} height=${260} marker=${mark?.at ?? null} format=${number} legend=${!many}
				xRange=${panel.x.low !== null && panel.x.high !== null ? [panel.x.low, panel.x.high] : undefined} yRange=${[panel.y.low, panel.y.high]}
				onPick=${panel.series.some(opens) ? pick : undefined}
			/>
			${panel.color ? html`<${ScaleLegend} panel=${panel} />` : null}
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
			<div class="figure__panels">${(found?.panels ?? []).map((panel, index) => html`<${Panel} key=${index} evaluation=${evaluation} panel=${panel} alone=${found?.panels.length === 1} open=${open} />`)}</div>
			${found?.note ? html`<p class="note">${found.note}</p>` : null}
		</section>
	`;
}
