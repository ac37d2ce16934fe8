// @ts-check
/** How a chart is drawn. */

/** @import uPlot from 'uplot' */
/** @import {ChartColour} from '../lib/chart_colours.js' */
/** @import {ChartProps, Curve} from './chart.js' */

const FONT = '12px Inter, system-ui, "DejaVu Sans", sans-serif';

/** @typedef {{current: ChartProps}} Props */

/** @param {Curve} curve @param {Record<ChartColour, string>} colours @returns {uPlot.Series} */
function seriesOf({ label, colour, dash, points, gaps }, colours) {
	const stroke = colours[colour];
	if (points) return { label, stroke, paths: () => null, points: { show: true, size: points === true ? 7 : points, fill: stroke, stroke } };
	return { label, stroke, width: 2, dash, spanGaps: !gaps, points: { show: false } };
}

/** @param {number} place */
function tickText(place) {
	return place.toLocaleString('en-GB', { maximumFractionDigits: 6 }).replace('-', '−');
}

/** Height of a line of numbers, and the width of one digit with what stands between two numbers, CSS pixels. */
const [LINE, DIGIT, BETWEEN] = [16, 7.5, 16];

/** Room that the numbers below a picture need side by side. @param {uPlot} _plot @param {number} _axis @param {number} low @param {number} high */
function roomBeside(_plot, _axis, low, high) {
	return BETWEEN + DIGIT * Math.max(...[low, high].map((end) => tickText(Math.round(end)).length));
}

/** @param {string} label @param {Record<ChartColour, string>} colours @param {number} size pixels @param {boolean} [compact] @param {uPlot.Axis.Space} [space] of two numbers, where it is compact @returns {uPlot.Axis} */
function axis(label, colours, size, compact, space = LINE) {
	const lines = { stroke: colours['chart-grid'], width: 1 };
	const named = compact ? { size: size - 8, space } : { label, labelFont: FONT, labelSize: 20, size };
	return { ...named, font: FONT, stroke: colours.muted, grid: lines, ticks: { ...lines, size: 4 }, values: (_plot, places) => places.map(tickText) };
}

/** The vertical line of a threshold, and the intervals of the values. @param {uPlot} plot @param {ChartProps} props @param {Record<ChartColour, string>} colours */
function drawOver(plot, { marker, curves }, colours) {
	const { ctx, bbox } = plot;
	ctx.save();
	ctx.beginPath();
	ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
	ctx.clip();
	curves.forEach((curve) => drawIntervals(plot, curve, colours[curve.colour]));
	if (marker !== null && marker !== undefined) {
		const left = plot.valToPos(marker, 'x', true);
		ctx.strokeStyle = colours.bad;
		ctx.lineWidth = 1.5 * devicePixelRatio;
		ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
		ctx.beginPath();
		ctx.moveTo(left, bbox.top);
		ctx.lineTo(left, bbox.top + bbox.height);
		ctx.stroke();
	}
	ctx.restore();
}

/** @param {uPlot} plot @param {Curve} curve @param {string} colour */
function drawIntervals(plot, { low, high }, colour) {
	if (!low || !high) return;
	const { ctx, data } = plot;
	ctx.strokeStyle = colour;
	ctx.lineWidth = devicePixelRatio;
	ctx.setLineDash([]);
	ctx.beginPath();
	data[0].forEach((place, index) => {
		const [from, to] = [low[index], high[index]];
		if (from === null || from === undefined || to === null || to === undefined) return;
		const left = plot.valToPos(place, 'x', true);
		ctx.moveTo(left, plot.valToPos(from, 'y', true));
		ctx.lineTo(left, plot.valToPos(to, 'y', true));
	});
	ctx.stroke();
}

/** Room beside the outermost values, as a share of the axis, so that no mark is cut at the border. */
const ROOM = 0.02;

/** @param {[number, number] | undefined} asked @param {number} low @param {number} high @returns {uPlot.Range.MinMax} */
function rangeX(asked, low, high) {
	const [from, to] = asked ?? [low, high > low ? high : low + 1];
	const room = ROOM * (to - from);
	return [from - room, to + room];
}

/** The ends of values with their intervals, of which so much is seen as the values span. @param {Curve[]} curves @param {number} low @param {number} high @returns {[number, number]} */
export function withIntervals(curves, low, high) {
	const most = high > low ? high - low : Math.max(1, Math.abs(high) * 0.1);
	let [least, largest] = [low, high];
	for (const { low: from, high: to } of curves) {
		if (!from || !to) continue;
		for (const value of from) if (typeof value === 'number' && value < least) least = value;
		for (const value of to) if (typeof value === 'number' && value > largest) largest = value;
	}
	return [Math.max(least, low - most), Math.min(largest, high + most)];
}

/** @param {[number | null, number | null] | undefined} asked @param {number} low @param {number} high @returns {uPlot.Range.MinMax} */
function rangeY(asked, low, high) {
	const room = high > low ? (high - low) * 0.06 : Math.max(1, Math.abs(high) * 0.1);
	const [from, to] = [asked?.[0] ?? low - room, asked?.[1] ?? high + room];
	// A curve along the end of the axis would be drawn by half.
	const half = (ROOM / 2) * (to - from);
	return [from - half, to + half];
}

/**
 * @param {Props} props always the newest, so that a change needs no new plot
 * @param {{width: number, height: number, colours: Record<ChartColour, string>, setAt: (at: number | null) => void}} frame
 * @returns {uPlot.Options}
 */
export function chartOptions(props, { width, height, colours, setAt }) {
	const { curves, xLabel, yLabel, compact } = props.current;
	return {
		width,
		height,
		legend: { show: false },
		padding: [10, 12, 0, 0],
		cursor: { y: false, drag: { x: false, y: false }, points: { size: 6 } },
		scales: {
			x: { time: false, range: (_plot, low, high) => rangeX(props.current.xRange, low, high) },
			y: { range: (_plot, low, high) => rangeY(props.current.yRange, ...withIntervals(props.current.curves, low ?? 0, high ?? 1)) },
		},
		axes: [axis(xLabel, colours, 34, compact, roomBeside), axis(yLabel, colours, 52, compact)],
		series: [{}, ...curves.map((curve) => seriesOf(curve, colours))],
		hooks: {
			draw: [(plot) => drawOver(plot, props.current, colours)],
			setCursor: [(plot) => setAt(plot.cursor.idx ?? null)],
			ready: [(plot) => {
				plot.over.addEventListener('click', () => {
					const { idx, top } = plot.cursor;
					if (idx === null || idx === undefined) return;
					props.current.onPick?.(idx, top === undefined ? null : plot.posToVal(top, 'y'));
				});
			}],
		},
	};
}
