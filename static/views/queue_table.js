// @ts-check
/** The rows of the queue: only those in sight exist. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';

import { count } from '../lib/format.js';
import { useKeys } from '../lib/hooks.js';
import { navigate } from '../lib/router.js';
import { useVirtualList } from '../lib/virtual_list.js';
import { reviewAddress } from '../state/navigation.js';
import { valueOf, withField } from '../state/query.js';
import { activeRow, look, queue } from '../state/queue.js';
import { rowAt } from '../state/queue_pages.js';
import { arrivals, leftAt, remember } from '../state/queue_place.js';
import { countOf, extendTicks, isTicked, ticks, turnAll, turnTick } from '../state/queue_ticks.js';
import { QueueRow } from './queue_row.js';
import { VALUE_OF_REVIEW } from './value_of_review.js';

const ROW = 72;
/** Rows drawn while nobody knows yet how many there are. */
const UNKNOWN = 12;

const COLUMNS = [
	{ label: '', hidden: 'Frame' },
	{ label: 'Group', sort: 'number' },
	{ label: 'Status', sort: 'status' },
	{ label: 'First failing gate', sort: 'gate' },
	{ label: 'margin', sort: 'margin', numeric: true, value: true },
	{ label: 'min JaC', sort: 'jac', numeric: true },
	{ label: 'paint', sort: 'agreement', numeric: true, paint: true },
	{ label: 'px', sort: 'error', numeric: true },
	{ label: 'σ m', sort: 'sigma', numeric: true },
	{ label: 'β', sort: 'parallax', numeric: true },
	{ label: 'Ø', sort: 'ratio', numeric: true },
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
	const byValue = column.value && orderOf(q, 'value') !== undefined;
	/** @param {string} name */
	const turn = (name) => onQuery(withField(q, 'sort', [`sort:${name}${order === 'ascending' ? '-desc' : ''}`]));
	return html`
		<div role="columnheader" class="queue-cell" data-narrow=${Boolean(column.narrow)} data-numeric=${Boolean(column.numeric)} aria-sort=${sort ? (order ?? 'none') : undefined}>
			${sort ? html`
				<button type="button" data-term=${`column:${sort}`} onClick=${() => turn(sort)}>
					${column.label}<span aria-hidden="true">${order === 'ascending' ? ' ↑' : order === 'descending' ? ' ↓' : ''}</span>
				</button>${byValue ? html`<small class="queue-cell__order" title=${VALUE_OF_REVIEW}>by value</small>` : null}` : html`${column.label}${column.hidden ? html`<span class="hidden-text">${column.hidden}</span>` : null}`}
		</div>
	`;
}

/** Ticks everything that matches, seen or not. */
function HeadTick() {
	const { total, loaded } = queue.value;
	const ticked = countOf(ticks.value, total);
	return html`
		<div role="columnheader" class="queue-cell queue-cell--tick">
			<label class="tick" title=${ticked === total ? 'Untick all' : `Tick all ${count(total)} that match`}>
				<input
					type="checkbox" disabled=${!loaded || total === 0} checked=${ticked > 0 && ticked === total}
					indeterminate=${ticked > 0 && ticked < total} onChange=${turnAll} aria-label="Tick all groups that match"
				/>
			</label>
		</div>
	`;
}

/** Whether a key has just moved the active row, which then comes into sight and has the focus. */
const following = { current: false };

/** Move the active row, within what there is. @param {number} by */
function step(by) {
	const last = queue.value.total - 1;
	following.current = true;
	activeRow.value = Math.max(0, Math.min(last, activeRow.value + by));
}

/** @param {1 | -1} by */
function extend(by) {
	following.current = true;
	extendTicks(by);
}

function openActive() {
	const row = rowAt(queue.value.pages, activeRow.value);
	if (row) navigate(reviewAddress(row.id, queue.value.q));
}

/** @type {import('../lib/keys.js').Binding[]} */
const KEYS = [
	{ keys: ['ArrowDown', 'j'], label: 'Next row', group: 'Queue', repeats: true, run: () => step(1) },
	{ keys: ['ArrowUp', 'k'], label: 'Previous row', group: 'Queue', repeats: true, run: () => step(-1) },
	{ keys: ['PageDown'], label: 'Ten rows down', group: 'Queue', repeats: true, run: () => step(10) },
	{ keys: ['PageUp'], label: 'Ten rows up', group: 'Queue', repeats: true, run: () => step(-10) },
	{ keys: ['Home'], label: 'First row', group: 'Queue', run: () => step(-Infinity) },
	{ keys: ['End'], label: 'Last row', group: 'Queue', run: () => step(Infinity) },
	{ keys: ['Enter'], label: 'Open the row', group: 'Queue', run: openActive },
	{ keys: [' '], label: 'Tick the row, or untick it', group: 'Queue', run: () => turnTick(activeRow.value) },
	{ keys: ['Shift+ArrowDown'], label: 'Extend the ticks downwards', group: 'Queue', repeats: true, run: () => extend(1) },
	{ keys: ['Shift+ArrowUp'], label: 'Extend the ticks upwards', group: 'Queue', repeats: true, run: () => extend(-1) },
];

/** First pixel in sight, as near as can be, with which a row is. @param {number} top @param {number} height @param {number} row */
function reaching(top, height, row) {
	if (row * ROW < top) return row * ROW;
	return Math.max(top, (row + 1) * ROW - height);
}

/** @import {VirtualList} from '../lib/virtual_list.js' */
/** @typedef {import('preact').RefObject<HTMLDivElement | null>} Scroller */

/** Scroll to where somebody was when rows arrive, and along with keys. @param {Scroller} scroller @param {VirtualList} list */
function useScrolling(scroller, list) {
	const { shown } = queue.value;
	const active = activeRow.value;
	const arrived = `${shown} ${arrivals.value}`;
	const before = useRef('');
	useLayoutEffect(() => {
		const element = scroller.current;
		if (!element || shown === '') return;
		const arriving = before.current !== arrived;
		before.current = arrived;
		const left = leftAt(shown);
		if (arriving) list.moveTo(left.top * ROW);
		// Who had scrolled away from the active row finds what was in sight.
		if (following.current || (arriving && active !== left.active)) {
			list.moveTo(reaching(list.top(), element.clientHeight, active));
			// In a low window the page around the rows scrolls too.
			if (following.current) element.scrollIntoView({ block: 'nearest' });
		}
		remember(shown, list.top() / ROW);
	}, [arrived, active]);
}

/** Keep the focus on the active row while keys move it. @param {Scroller} scroller @param {boolean} there whether that row is drawn */
function useRovingFocus(scroller, there) {
	const active = activeRow.value;
	useEffect(() => {
		// The next key may have come already: that row then has the focus, not this one.
		if (!there || !following.current || activeRow.value !== active) return;
		following.current = false;
		/** @type {HTMLElement | null | undefined} */
		const row = scroller.current?.querySelector('[data-active="true"]');
		row?.focus({ preventScroll: true });
	}, [active, there]);
}

/** @param {{q: string, painted: boolean, onQuery: (q: string) => void}} props `painted`: cameras are found from paint */
export function QueueTable({ q, painted, onQuery }) {
	const scroller = useRef(/** @type {HTMLDivElement | null} */ (null));
	const { pages, total, loaded, shown } = queue.value;
	const rows = loaded ? total : UNKNOWN;
	const list = useVirtualList(scroller, {
		count: rows, rowHeight: ROW, onScroll: (top) => { if (shown) remember(shown, top / ROW); },
	});
	const first = list.rows[0] ?? 0;
	const last = list.rows.at(-1) ?? 0;
	const active = activeRow.value;
	useKeys(KEYS);
	useScrolling(scroller, list);
	useRovingFocus(scroller, list.rows.includes(active));
	useEffect(() => { if (total > 0) look(first, last); }, [first, last, total, pages]);
	return html`
		<section class="card queue-table" role="grid" data-painted=${painted} aria-label="Groups" aria-multiselectable="true" aria-rowcount=${loaded ? total + 1 : -1} aria-busy=${!loaded}>
			<div class="queue-row queue-row--head" role="row" aria-rowindex="1">
				<${HeadTick} />
				${COLUMNS.filter(({ paint }) => painted || !paint).map((column) => html`<${HeadCell} key=${column.label} column=${column} q=${q} onQuery=${onQuery} />`)}
			</div>
			<div class="queue-table__rows" role="rowgroup" ref=${scroller} tabindex="0" aria-label="Rows">
				<div role="presentation" class="queue-table__space" style=${{ height: `${list.space}px` }}>
					${list.rows.map((index) => {
						const row = rowAt(pages, index);
						return html`
							<${QueueRow}
								key=${index} index=${index} start=${list.placeOf(index)} row=${row} q=${q} painted=${painted} active=${loaded && index === active}
								ticked=${row !== null && isTicked(ticks.value, row.id)}
							/>`;
					})}
				</div>
			</div>
		</section>
	`;
}
