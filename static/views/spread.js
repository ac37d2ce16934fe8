// @ts-check
/** One histogram with a part for each split. Its bars are links; arrow keys go from bar to bar. */

import { html } from 'htm/preact';
import { useRef, useState } from 'preact/hooks';

import { count, plural } from '../lib/format.js';
import { NOISE_ASSUMED } from '../state/datasets.js';
import { queueAddress } from '../state/navigation.js';
import { withField, wordsOf } from '../state/query.js';
import { BinAxis, endsOf, noneOf } from './bin_axis.js';

/** @import {SpreadJson} from '../api/statistics.js' */

const COLOURS = ['chart-a', 'chart-b', 'chart-c', 'chart-d', 'chart-e', 'chart-f'];

/** @param {number} index of the split */
export function seriesColour(index) {
	return COLOURS[index % COLOURS.length];
}

/** The query that asks for one bar of those that match. @param {SpreadJson} spread @param {number} bin @param {string} q */
function queryOf({ field, queries }, bin, q) {
	return withField(q, field, wordsOf(queries[bin]));
}

/** What the picture does not say: how tall it is, and who is not in it. @param {{most: number, unknown: number, name: string, note: string}} props */
function Aside({ most, unknown, name, note }) {
	if (most === 0) return html`<p class="note">${noneOf(name)}</p>`;
	const without = unknown ? ` · ${plural(unknown, 'group')} without this number` : '';
	return html`<p class="note">Tallest bar: ${plural(most, 'group')}${without}${note ? html` · <span title=${NOISE_ASSUMED}>${note}</span>` : null}</p>`;
}

/** @param {{spread: SpreadJson, dataset: string, q: string, note?: string}} props */
export function Spread({ spread, dataset, q, note = '' }) {
	const { name, label, unit, edges, series } = spread;
	const list = useRef(/** @type {HTMLUListElement | null} */ (null));
	const [at, setAt] = useState(0);
	const totals = edges.slice(1).map((_, bin) => series.reduce((sum, { counts }) => sum + counts[bin], 0));
	const most = Math.max(0, ...totals);
	const unknown = series.reduce((sum, one) => sum + one.unknown, 0);
	/** @param {KeyboardEvent} event */
	function key(event) {
		const steps = /** @type {{[key: string]: number}} */ ({ ArrowRight: 1, ArrowLeft: -1, Home: -totals.length, End: totals.length });
		if (!steps[event.key]) return;
		event.preventDefault();
		const next = Math.max(0, Math.min(totals.length - 1, at + steps[event.key]));
		setAt(next);
		/** @type {HTMLElement | null | undefined} */ (list.current?.children[next]?.querySelector('a'))?.focus();
	}
	return html`
		<section class="card spread" aria-labelledby=${`spread-${name}`}>
			<h2 id=${`spread-${name}`}>${label}${unit ? `, ${unit}` : ''} <span class="card__aside">${count(totals.reduce((a, b) => a + b, 0))}</span></h2>
			<ul class="spread__bars" ref=${list} onKeyDown=${key}>
				${totals.map((total, bin) => {
					const said = `${endsOf(spread, bin, unit)}: ${plural(total, 'group')}`;
					const parts = series.map(({ split, counts }, index) => html`
						<i key=${split} data-colour=${seriesColour(index)} style=${{ height: `${(100 * counts[bin]) / Math.max(1, most)}%` }}></i>`);
					return html`
						<li key=${bin}>
							<a
								class="spread__bar" href=${queueAddress(dataset, queryOf(spread, bin, q))} aria-label=${said} title=${said}
								tabindex=${bin === at ? 0 : -1} onFocus=${() => setAt(bin)}
							>${parts}</a>
						</li>`;
				})}
			</ul>
			<${BinAxis} bins=${spread} />
			<${Aside} most=${most} unknown=${unknown} name=${name} note=${note} />
		</section>
	`;
}
