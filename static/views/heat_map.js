// @ts-check
/** Where on the pitch the balls are; each cell leads to its groups, arrow keys go from cell to cell. */

import { html } from 'htm/preact';
import { useRef, useState } from 'preact/hooks';

import { pathFromAbove, pitchMarkings } from '../geometry/pitch.js';
import { count, fixed, plural } from '../lib/format.js';
import { queueAddress } from '../state/navigation.js';
import { withField } from '../state/query.js';

/** @import {StatisticsJson} from '../api/statistics.js' */

const LENGTH = 105;
const WIDTH = 68;

/** @typedef {{left: number, right: number, top: number, bottom: number, n: number}} Cell */

const LINES = [...pitchMarkings(LENGTH, WIDTH)].filter(([name]) => !name.startsWith('Goal')).map(([, points]) => pathFromAbove(points));

/** Cells with balls, row by row. @param {StatisticsJson['positions']} positions @returns {Cell[]} */
function cellsOf({ x_edges: xs, y_edges: ys, counts }) {
	return counts.flatMap((row, y) => row.flatMap((n, x) => (n === 0 ? [] : [
		{ left: xs[x], right: xs[x + 1], top: ys[y], bottom: ys[y + 1], n },
	])));
}

/** The query that asks for one cell. @param {Cell} cell @param {string} q */
function queryOf({ left, right, top, bottom }, q) {
	return withField(withField(q, 'x', [`x>=${left}`, `x<${right}`]), 'y', [`y>=${top}`, `y<${bottom}`]);
}

/** @param {{positions: StatisticsJson['positions'], dataset: string, q: string}} props `counts[row][column]`, rows along y */
export function HeatMap({ positions, dataset, q }) {
	const { x_edges: xs, y_edges: ys } = positions;
	const drawing = useRef(/** @type {SVGSVGElement | null} */ (null));
	const [at, setAt] = useState(0);
	const cells = cellsOf(positions);
	const most = Math.max(1, ...cells.map(({ n }) => n));
	const all = cells.reduce((sum, { n }) => sum + n, 0);
	const [left, top] = [xs[0] - 2, ys[0] - 2];
	const [width, height] = [xs[xs.length - 1] - xs[0] + 4, ys[ys.length - 1] - ys[0] + 4];
	/** @param {KeyboardEvent} event */
	function key(event) {
		const steps = /** @type {{[key: string]: number}} */ ({ ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 });
		if (!steps[event.key]) return;
		event.preventDefault();
		const next = Math.max(0, Math.min(cells.length - 1, at + steps[event.key]));
		setAt(next);
		drawing.current?.querySelectorAll('a')[next]?.focus();
	}
	return html`
		<section class="card heat-map" aria-labelledby="heat-title">
			<h2 id="heat-title">Where the balls were on the pitch <span class="card__aside">${plural(all, 'ball')}, at most ${count(most)} in one cell</span></h2>
			<svg viewBox=${`${left} ${top} ${width} ${height}`} role="group" aria-label="The pitch from above" ref=${drawing} onKeyDown=${key}>
				<rect class="heat-map__grass" x=${left} y=${top} width=${width} height=${height} />
				${LINES.map((line) => html`<path class="heat-map__line" d=${line} />`)}
				${cells.map((cell, index) => {
					const said = `${plural(cell.n, 'ball')} at x ${fixed((cell.left + cell.right) / 2, 0, ' m')}, y ${fixed((cell.top + cell.bottom) / 2, 0, ' m')}`;
					return html`
						<a key=${said} href=${queueAddress(dataset, queryOf(cell, q))} aria-label=${said} tabindex=${index === at ? 0 : -1} onFocus=${() => setAt(index)}>
							<rect
								class="heat-map__cell" x=${cell.left} y=${cell.top} width=${cell.right - cell.left} height=${cell.bottom - cell.top}
								fill-opacity=${0.2 + 0.75 * Math.sqrt(cell.n / most)}
							><title>${said}</title></rect>
						</a>`;
				})}
			</svg>
			<p class="heat-map__scale" aria-hidden="true"><span>1</span><i></i><span>${count(most)}</span></p>
		</section>
	`;
}
