// @ts-check
/** A table of a run; a row whose frames are known opens them. */

import { html } from 'htm/preact';

import { tableAddress } from '../../api/evaluations.js';
import { count } from '../../lib/format.js';
import { Cell, number } from './cell.js';

/** @import {CellJson, FrameQuery, TableJson, TableRowJson} from '../../api/evaluations.js' */

/** When every cell of a row counts the same, it is said once. @param {CellJson[]} cells */
function shared(cells) {
	const [first] = cells;
	return first && cells.every(({ count: n, of }) => n === first.count && of === first.of) ? first : null;
}

/** @param {{row: TableRowJson, open: (query: FrameQuery, title: string) => void}} props */
function Row({ row, open }) {
	const { frames, cells, label } = row;
	const same = shared(cells);
	return html`
		<tr>
			<th scope="row">${frames
				? html`<button class="link-button" type="button" onClick=${() => open({ ...frames }, label)}>${label}</button>` : label}</th>
			${cells.map((cell, index) => html`<td key=${index} data-numeric="true">
				${same ? html`<span class="cell"><strong>${number(cell.value)}</strong>${cell.low !== null && cell.high !== null ? html`<small title="95 % interval">${number(cell.low)} to ${number(cell.high)}</small>` : null}</span>` : html`<${Cell} cell=${cell} />`}
			</td>`)}
			<td data-numeric="true" class="cell__denominator">${same ? `${count(same.count)} of ${count(same.of)}` : ''}</td>
		</tr>
	`;
}

const ARROWS = /** @type {{[better: string]: string}} */ ({ higher: ' ↑', lower: ' ↓' });

/** @param {{evaluation: number, table: TableJson, open: (query: FrameQuery, title: string) => void}} props */
export function TableCard({ evaluation, table, open }) {
	return html`
		<section class="card card--flush" aria-labelledby=${`table-${table.name}`}>
			<h2 id=${`table-${table.name}`}>${table.title}
				<span class="card__aside buttons">${/** @type {const} */ (['csv', 'json']).map((ending) => html`<a key=${ending} class="link" href=${tableAddress(evaluation, table.name, ending)} download=${`${table.name}.${ending}`}>${ending.toUpperCase()}<span class="hidden-text"> of ${table.title}</span></a>`)}</span></h2>
			<div class="table__scroll" tabindex="0" role="region" aria-label=${table.title}>
				<table class="table">
					<thead><tr><td></td>${table.columns.map((column) => html`
						<th key=${column.name} data-numeric="true" title=${column.better ? `${column.better} is better` : undefined}>${column.label}${column.unit ? `, ${column.unit}` : ''}${ARROWS[column.better] ?? ''}</th>`)}<th data-numeric="true">from</th></tr></thead>
					<tbody>${table.rows.map((row) => html`<${Row} key=${row.name} row=${row} open=${open} />`)}</tbody>
				</table>
			</div>
			${table.note ? html`<p class="yield__note">${table.note}</p>` : null}
		</section>
	`;
}
