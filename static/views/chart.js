// @ts-check
/** Curves over one axis. What the picture shows, the table below it says. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import uPlot from 'uplot';

import { chartColours } from '../lib/chart_colours.js';
import { useSize } from '../lib/hooks.js';
import { chartOptions } from './chart_options.js';

/** @import {ChartColour} from '../lib/chart_colours.js' */

/**
 * @typedef {object} Curve
 * @property {string} label
 * @property {(number | null)[]} values one for each x
 * @property {ChartColour} colour
 * @property {number[]} [dash]
 * @property {boolean | number} [points] points without a line between them; a number is their size in pixels
 * @property {boolean} [gaps] no line where values are missing
 * @property {(number | null)[]} [low] lower end of the interval of each value
 * @property {(number | null)[]} [high]
 */

/**
 * @typedef {object} ChartProps
 * @property {string} name what the picture shows, in one sentence
 * @property {string} xLabel
 * @property {string} yLabel
 * @property {number[]} x
 * @property {Curve[]} curves
 * @property {number} [height]
 * @property {[number, number]} [xRange]
 * @property {[number | null, number | null]} [yRange] null: what the values need
 * @property {number | null} [marker] x of a vertical line
 * @property {(value: number) => string} [format] of values
 * @property {(index: number, y: number | null) => void} [onPick] when somebody clicks at a place of x, and at which height
 * @property {boolean} [legend] false: too many curves for one
 * @property {boolean} [compact] one of several over the same x: without names of its axes, and its numbers are elsewhere
 */

const HEIGHT = 300;

/** @param {Curve} curve */
function Swatch({ colour, dash, points }) {
	return html`
		<svg class="chart__swatch" viewBox="0 0 22 8" aria-hidden="true" data-colour=${colour}>
			${points ? html`<circle cx="11" cy="4" r="3" />` : html`<path d="M0 4h22" stroke-dasharray=${dash?.join(' ')} />`}
		</svg>
	`;
}

/** @param {ChartProps & {at: number | null}} props */
function Legend({ curves, x, xLabel, at, format = String }) {
	return html`
		<p class="chart__legend">
			${curves.map((curve) => {
				const value = at === null ? null : curve.values[at];
				return html`<span key=${curve.label}><${Swatch} ...${curve} />${curve.label}${value === null || value === undefined ? '' : html` <strong>${format(value)}</strong>`}</span>`;
			})}
			<span class="chart__at">${at === null ? '' : `${xLabel} ${Number(x[at].toPrecision(4))}`}</span>
		</p>
	`;
}

/** The same as numbers; made when somebody wants them, for there can be thousands. @param {Pick<ChartProps, 'curves' | 'x' | 'xLabel' | 'format'>} props */
export function Numbers({ curves, x, xLabel, format = String }) {
	const [open, setOpen] = useState(false);
	/** @param {number | null | undefined} value */
	const text = (value) => (value === null || value === undefined ? '–' : format(value));
	return html`
		<details class="chart__numbers" onToggle=${(/** @type {Event} */ event) => setOpen(/** @type {HTMLDetailsElement} */ (event.target).open)}>
			<summary>As numbers</summary>
			${open ? html`
				<div class="table__scroll" tabindex="0" role="region" aria-label="Numbers of the curve">
					<table class="table">
						<thead><tr><th data-numeric="true">${xLabel}</th>${curves.map(({ label }, index) => html`<th key=${index} data-numeric="true">${label}</th>`)}</tr></thead>
						<tbody>${x.map((place, row) => html`
							<tr key=${row}>
								<th scope="row" data-numeric="true">${Number(place.toPrecision(4))}</th>
								${curves.map(({ values }, index) => html`<td key=${index} data-numeric="true">${text(values[row])}</td>`)}
							</tr>`)}
						</tbody>
					</table>
				</div>` : null}
		</details>
	`;
}

/** @param {ChartProps} props */
export function Chart(props) {
	const { name, x, curves, height = HEIGHT } = props;
	const [box, { width }] = useSize();
	const plot = useRef(/** @type {uPlot | null} */ (null));
	const latestProps = useRef(props);
	latestProps.current = props;
	const [at, setAt] = useState(/** @type {number | null} */ (null));
	const colours = chartColours.value;
	const data = /** @type {uPlot.AlignedData} */ ([x, ...curves.map(({ values }) => values)]);
	const shape = curves.map(({ label, dash, points, colour }) => [label, dash, points, colour].join()).join(';');
	useEffect(() => {
		if (!box.current || width === 0) return undefined;
		const options = chartOptions(latestProps, { width, height, colours, setAt });
		const made = new uPlot(options, data, box.current);
		plot.current = made;
		return () => {
			plot.current = null;
			made.destroy();
		};
	}, [width > 0, height, colours, shape]);
	useEffect(() => { if (width > 0) plot.current?.setSize({ width, height }); }, [width, height]);
	useEffect(() => { plot.current?.setData(data); }, [x, curves, props.marker]);
	return html`
		<div class="chart">
			<div class="chart__plot" role="img" aria-label=${name} data-pick=${Boolean(props.onPick)} ref=${box} style=${{ height: `${height}px` }}></div>
			${props.legend === false ? null : html`<${Legend} ...${props} at=${at} />`}
			${props.compact ? null : html`<${Numbers} ...${props} />`}
		</div>
	`;
}
