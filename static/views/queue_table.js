// @ts-check
/** The rows of the queue: only those in sight exist. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { useKeys } from '../lib/hooks.js';
import { navigate } from '../lib/router.js';
import { useVirtualList } from '../lib/virtual_list.js';
import { reviewAddress } from '../state/navigation.js';
import { valueOf, withField } from '../state/query.js';
import { activeRow, need, queue } from '../state/queue.js';
import { QueueRow } from './queue_row.js';

const ROW = 72;

const COLUMNS = [
	{ label: '', hidden: 'Frame' },
	{ label: 'Group', sort: 'number' },
	{ label: 'Status', sort: 'status' },
	{ label: 'First failing gate', sort: 'gate' },
	{ label: 'margin', sort: 'margin', numeric: true },
	{ label: 'min JaC', sort: 'jac', numeric: true },
	{ label: 'px', sort: 'error', numeric: true, title: 'Largest reprojection error of the ball' },
	{ label: 'σ m', sort: 'sigma', numeric: true, title: 'Uncertainty of the ball’s position' },
	{ label: 'β', sort: 'parallax', numeric: true, title: 'Parallax: the largest angle between two rays' },
	{ label: 'Ø', sort: 'ratio', numeric: true, title: 'Ball box against the expected diameter' },
	{ label: 'views', sort: 'views', numeric: true },
	{ label: 'split', sort: 'split', narrow: true },
	{ label: 'Findings', sort: 'findings' },
];

/** @param {string} q @param {string} name @returns {'ascending' | 'descending' | undefined} */
function orderOf(q, name) {
	const sort = valueOf(q, 'sort') || 'number';
	if (sort === name) return 'ascending';
	return sort === `${name}-desc` ? 'descending' : undefined;
}

/** @param {{column: typeof COLUMNS[number], q: string, onQuery: (q: string) => void}} props */
function HeadCell({ column, q, onQuery }) {
	const { sort } = column;
	const order = sort ? orderOf(q, sort) : undefined;
	/** @param {string} name */
	const turn = (name) => onQuery(withField(q, 'sort', [`sort:${name}${order === 'ascending' ? '-desc' : ''}`]));
	return html`
		<div role="columnheader" class="queue-cell" data-narrow=${Boolean(column.narrow)} data-numeric=${Boolean(column.numeric)} title=${column.title} aria-sort=${sort ? (order ?? 'none') : undefined}>
			${sort ? html`
				<button type="button" onClick=${() => turn(sort)}>
					${column.label}<span aria-hidden="true">${order === 'ascending' ? ' ↑' : order === 'descending' ? ' ↓' : ''}</span>
				</button>` : html`${column.label}${column.hidden ? html`<span class="hidden-text">${column.hidden}</span>` : null}`}
		</div>
	`;
}

/** Move the active row, within what there is. @param {number} by */
function step(by) {
	const last = queue.value.total - 1;
	activeRow.value = Math.max(0, Math.min(last, activeRow.value + by));
}

function openActive() {
	const row = queue.value.rows[activeRow.value];
	if (row) navigate(reviewAddress(row.id, queue.value.q));
}

/** @type {import('../lib/keys.js').Binding[]} */
const KEYS = [
	{ keys: ['ArrowDown', 'j'], label: 'Next row', group: 'Queue', run: () => step(1) },
	{ keys: ['ArrowUp', 'k'], label: 'Previous row', group: 'Queue', run: () => step(-1) },
	{ keys: ['PageDown'], label: 'Ten rows on', group: 'Queue', run: () => step(10) },
	{ keys: ['PageUp'], label: 'Ten rows back', group: 'Queue', run: () => step(-10) },
	{ keys: ['Home'], label: 'First row', group: 'Queue', run: () => step(-Infinity) },
	{ keys: ['End'], label: 'Last row', group: 'Queue', run: () => step(Infinity) },
	{ keys: ['Enter'], label: 'Open the row', group: 'Queue', run: openActive },
];

/** @param {{q: string, onQuery: (q: string) => void}} props */
export function QueueTable({ q, onQuery }) {
	const scroller = useRef(/** @type {HTMLDivElement | null} */ (null));
	const { rows, total } = queue.value;
	const list = useVirtualList(scroller, { count: total, rowHeight: ROW });
	const items = list.getVirtualItems();
	const last = items.at(-1)?.index ?? 0;
	const active = activeRow.value;
	useKeys(KEYS);
	useEffect(() => { if (total > 0) need(last); }, [last, total, rows.length]);
	useEffect(() => { if (total > 0) list.scrollToIndex(active, { align: 'auto' }); }, [active, total > 0]);
	return html`
		<section class="card queue-table" role="grid" aria-label="Groups" aria-rowcount=${total + 1}>
			<div class="queue-row queue-row--head" role="row" aria-rowindex="1">
				${COLUMNS.map((column) => html`<${HeadCell} key=${column.label} column=${column} q=${q} onQuery=${onQuery} />`)}
			</div>
			<div class="queue-table__rows" role="rowgroup" ref=${scroller} tabindex="0" aria-label="Rows">
				<div role="presentation" class="queue-table__space" style=${{ height: `${list.getTotalSize()}px` }}>
					${items.map(({ index, start }) => html`
						<${QueueRow}
							key=${index} index=${index} start=${start} row=${rows[index] ?? null}
							q=${q} active=${index === active}
						/>`)}
				</div>
			</div>
		</section>
	`;
}
