// @ts-check
/** The curve of a timeline: error over frames, which of them pass, what people decided. */

/** @import {TimelineJson} from '../../api/timeline.js' */

/** @typedef {{from: number, to: number}} Span   indices of groups */
/** @typedef {{width: number, height: number}} Size   CSS pixels */
/**
 * @typedef {object} Look colours of the page
 * @property {string} ok
 * @property {string} warn
 * @property {string} bad
 * @property {string} muted
 * @property {string} ink
 * @property {string} grid
 * @property {string} head
 */
/**
 * @typedef {object} Curve
 * @property {TimelineJson} columns
 * @property {Span} span
 * @property {number} limit pixels: errors from here on fail
 * @property {number} position of the group on screen, -1 when not there
 * @property {ReadonlyMap<number, number>} [leftOut] pixels by which the track misses the balls that it was made without, by index, where an edit was made
 */
/** @typedef {{worst: number | null, passes: number, fails: number, open: number, status: string, stale: boolean}} Column */

/** Lanes above and below the curve, CSS pixels. */
const FAIL_LANE = 9;
const VERDICT_LANE = 9;
const PAD = 3;
/** Errors that get a line of their own. */
const LEVELS = [1, 10, 100, 1000];

/** Place of an index on screen. @param {Span} span @param {number} width @param {number} index */
export function toX({ from, to }, width, index) {
	return PAD + ((index - from) / Math.max(1, to - from)) * (width - 2 * PAD);
}

/** Index at a place on screen. @param {Span} span @param {number} width @param {number} x */
export function toIndex({ from, to }, width, x) {
	return Math.round(from + ((x - PAD) / Math.max(1, width - 2 * PAD)) * (to - from));
}

/** The largest error that the curve shows. @param {TimelineJson} columns @param {number} limit */
export function topOf({ error_px: errors }, limit) {
	return Math.max(2 * limit, ...errors.map((error) => error ?? 0));
}

/** Share of the curve's height; logarithmic, for errors span four decades. @param {number} error @param {number} top */
export function heightOf(error, top) {
	return Math.log1p(error) / Math.log1p(top);
}

/** How a verdict ranks where several share a pixel: what needs a person first. */
const RANK = ['', 'unreviewed', 'accepted', 'deferred', 'rejected'];

/**
 * What each column of pixels has to show: the worst of all its groups.
 *
 * @param {Curve} curve @param {number} width
 * @returns {Map<number, Column>}
 */
export function binned({ columns, span }, width) {
	/** @type {Map<number, Column>} */
	const bins = new Map();
	const last = Math.min(columns.id.length - 1, Math.ceil(span.to));
	for (let i = Math.max(0, Math.floor(span.from)); i <= last; i++) {
		const x = Math.round(toX(span, width, i));
		const bin = bins.get(x) ?? { worst: null, passes: 0, fails: 0, open: 0, status: '', stale: false };
		const error = columns.error_px[i];
		if (error !== null) bin.worst = Math.max(bin.worst ?? 0, error);
		bin[columns.passes[i] === null ? 'open' : columns.passes[i] ? 'passes' : 'fails'] += 1;
		if (RANK.indexOf(columns.status[i]) > RANK.indexOf(bin.status)) bin.status = columns.status[i];
		bin.stale ||= columns.stale[i];
		bins.set(x, bin);
	}
	return bins;
}

/** @param {CanvasRenderingContext2D} context @param {Size} size @param {Curve} curve @param {Look} look */
export function drawCurve(context, size, curve, look) {
	const { width, height } = size;
	const top = topOf(curve.columns, curve.limit);
	const [high, low] = [FAIL_LANE + PAD, height - VERDICT_LANE - PAD];
	/** @param {number} error */
	const toY = (error) => low - heightOf(error, top) * (low - high);
	context.clearRect(0, 0, width, height);
	drawLevels(context, width, toY, curve.limit, top, look);
	const bar = Math.max(1, Math.min(8, toX(curve.span, width, 1) - toX(curve.span, width, 0) - 1));
	for (const [x, column] of binned(curve, width)) {
		drawColumn(context, x, column, { bar, low, toY, height }, look);
	}
	for (const [index, px] of curve.leftOut ?? []) drawDiamond(context, toX(curve.span, width, index), toY(Math.min(px, top)), look);
	drawHead(context, toX(curve.span, width, curve.position), height, curve.position >= 0, look);
}

/** Height of a number beside the curve, CSS pixels. */
const LABEL = 12;

/**
 * @param {CanvasRenderingContext2D} context @param {number} width @param {(error: number) => number} toY
 * @param {number} limit @param {number} top @param {Look} look
 */
function drawLevels(context, width, toY, limit, top, look) {
	context.lineWidth = 1;
	context.strokeStyle = look.grid;
	context.fillStyle = look.muted;
	context.font = '10px Inter, system-ui, "DejaVu Sans", sans-serif';
	context.textAlign = 'right';
	context.textBaseline = 'bottom';
	let free = Infinity;
	for (const level of LEVELS.filter((one) => one < top)) {
		const y = toY(level);
		line(context, 0, y, width);
		// A low curve has no room for every number, and none for one on the dashes of the limit.
		const onLimit = toY(limit) > y - LABEL - 1 && toY(limit) < y + 1;
		if (y > free || onLimit) continue;
		context.fillText(`${level} px`, width - 2, y);
		free = y - LABEL;
	}
	context.setLineDash([4, 4]);
	context.strokeStyle = look.warn;
	line(context, 0, toY(limit), width);
	context.setLineDash([]);
}

/** @param {CanvasRenderingContext2D} context @param {number} x @param {number} y @param {number} width */
function line(context, x, y, width) {
	context.beginPath();
	context.moveTo(x, Math.round(y) + 0.5);
	context.lineTo(x + width, Math.round(y) + 0.5);
	context.stroke();
}

/**
 * @param {CanvasRenderingContext2D} context @param {number} x @param {Column} column
 * @param {{bar: number, low: number, toY: (error: number) => number, height: number}} place @param {Look} look
 */
function drawColumn(context, x, column, { bar, low, toY, height }, look) {
	const left = x - bar / 2;
	if (column.worst !== null) {
		context.fillStyle = column.fails ? look.bad : look.ok;
		const y = toY(column.worst);
		context.fillRect(left, y, bar, Math.max(1, low - y));
	}
	// Failing frames stand out by their place too, not by colour alone.
	if (column.fails) {
		context.fillStyle = look.bad;
		context.fillRect(left, 1, bar, FAIL_LANE - 3);
	}
	if (column.open) {
		context.fillStyle = look.muted;
		context.fillRect(left, FAIL_LANE - 3, bar, 2);
	}
	drawVerdict(context, left, bar, height, column, look);
}

/** @param {CanvasRenderingContext2D} context @param {number} left @param {number} bar @param {number} height @param {Column} column @param {Look} look */
function drawVerdict(context, left, bar, height, { status, stale }, look) {
	const colour = { accepted: look.ok, rejected: look.bad, deferred: look.muted }[status];
	if (!colour) return;
	context.fillStyle = stale ? look.warn : colour;
	// Accepted is a full block, rejected the lower half, deferred the upper one.
	const half = (VERDICT_LANE - 2) / 2;
	const y = height - VERDICT_LANE + 1 + (status === 'rejected' ? half : 0);
	context.fillRect(left, y, bar, status === 'accepted' ? 2 * half : half);
}

/** @param {CanvasRenderingContext2D} context @param {number} x @param {number} y @param {Look} look */
function drawDiamond(context, x, y, look) {
	context.fillStyle = look.ink;
	context.beginPath();
	for (const [dx, dy] of [[0, -4], [4, 0], [0, 4], [-4, 0]]) context.lineTo(x + dx, y + dy);
	context.fill();
}

/** @param {CanvasRenderingContext2D} context @param {number} x @param {number} height @param {boolean} there @param {Look} look */
function drawHead(context, x, height, there, look) {
	if (!there) return;
	context.fillStyle = look.head;
	context.fillRect(x - 1, 0, 2, height);
	context.beginPath();
	context.moveTo(x - 5, 0);
	context.lineTo(x + 5, 0);
	context.lineTo(x, 7);
	context.fill();
}
