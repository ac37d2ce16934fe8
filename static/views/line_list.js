// @ts-check
/** Every marking of every view, the worst fit first, each with its straightened band. */

import { html } from 'htm/preact';
import { useCallback } from 'preact/hooks';

import { plainMarking } from '../geometry/marking_words.js';
import { Canvas } from '../lib/canvas.js';
import { colours } from '../lib/colours.js';
import { pixelText, pixels } from '../lib/format.js';
import { useSize } from '../lib/hooks.js';
import { drawStrip } from '../overlays/line_strip.js';
import { useFrames, usePixels } from '../state/frames.js';
import { focusView, selected } from '../state/workspace.js';
import { Letter } from './letter.js';

/** @import {MarkingResiduals} from '../geometry/residual.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

const STRIP = 28;
const ROW = 34;
/** Drawing every strip of a large group would cost more than anybody reads. */
const MOST = 14;

/** @typedef {{picture: ViewPicture, marking: MarkingResiduals}} Row */

/** @param {ViewPicture[]} pictures @returns {Row[]} */
function rowsOf(pictures) {
	const rows = pictures.flatMap((picture) => picture.markings
		.filter(({ points }) => points.length > 0)
		.map((marking) => ({ picture, marking })));
	// Per cent of the diagonal, so that views of different sizes compare.
	return rows.sort((a, b) => share(b) - share(a));
}

/** @param {Row} row */
function share({ picture, marking }) {
	return marking.largest === null ? Infinity : marking.largest / picture.gamma;
}

/** Select the worst point of a marking. @param {Row} row */
function selectWorst({ picture, marking }) {
	focusView(picture.view.letter);
	const distances = marking.points.map(({ distance }) => distance ?? 0);
	const index = distances.indexOf(Math.max(...distances));
	selected.value = { kind: 'point', view: picture.view.key, marking: marking.marking, index };
}

/** @param {{row: Row, width: number, pixels: ImageData | undefined}} props */
function Strip({ row, width, pixels: data }) {
	const { picture, marking } = row;
	const theme = colours.value;
	const draw = useCallback((/** @type {CanvasRenderingContext2D} */ context) => {
		const scale = data ? data.width / picture.view.width : 1;
		drawStrip(context, { width, height: STRIP }, marking, data ?? null, scale, picture.view, picture.paint?.places(marking.marking) ?? []);
	}, [marking, width, data, theme, picture.paint]);
	return html`
		<li class="line-row">
			<button type="button" onClick=${() => selectWorst(row)} title=${`Select the worst point of ${marking.marking}`}>
				<${Letter} letter=${picture.view.letter} />
				<span class="line-row__name" title=${`${marking.marking}: ${plainMarking(marking.marking)}`}>${marking.marking}</span>
				${marking.polyline.length > 1
					? html`<${Canvas} class="line-row__strip" width=${width} height=${STRIP} draw=${draw} name="" />`
					: html`<span class="line-row__none">outside this view</span>`}
				<span class="line-row__value" data-grade=${marking.grade}>${pixels(marking.largest)} px</span>
			</button>
		</li>
	`;
}

/** @param {{pictures: ViewPicture[]}} props */
export function LineList({ pictures }) {
	const [ref, size] = useSize();
	const read = usePixels(useFrames(pictures.map(({ view }) => view)));
	const rows = rowsOf(pictures);
	const narrow = size.width < 330;
	const fitting = Math.max(1, Math.min(MOST, Math.floor(size.height / ROW)));
	const shown = rows.slice(0, fitting);
	const rest = rows[fitting];
	return html`
		<section class="card strip-card" data-card="lines" aria-label="Lines, worst first">
			<h2 title="The picture along each marking, straightened, with 12 pixels on either side; the worst first">Line strips${rest ? html`<span class="card__aside">${rows.length - fitting} more ${rows.length - fitting === 1 ? 'line' : 'lines'}, ${rows.length - fitting === 1 ? '' : 'all '}≤ ${pixelText(rest.marking.largest)}</span>` : null}</h2>
			<ul class="line-list" ref=${ref} data-narrow=${narrow}>
				${rows.length ? null : html`<li class="empty-note">No lines are annotated in this group.</li>`}
				${size.width < 100 ? null : shown.map((row) => html`
					<${Strip}
						key=${`${row.picture.view.key} ${row.marking.marking}`} row=${row}
						width=${Math.max(24, size.width - (narrow ? 210 : 232))} pixels=${read.get(row.picture.view.key)}
					/>`)}
			</ul>
		</section>
	`;
}
