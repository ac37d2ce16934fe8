// @ts-check
/** One group in the queue. */

import { html } from 'htm/preact';

import { degrees, fixed, marginText, pixels, words } from '../lib/format.js';
import { navigate } from '../lib/router.js';
import { reviewAddress } from '../state/navigation.js';
import { activeRow } from '../state/queue.js';
import { reasonText } from '../state/reasons.js';
import { isTicked, tickTo, ticks, turnTick } from '../state/queue_ticks.js';
import { GATE_TITLES } from './gate_names.js';
import { OpenComments } from './comments/open_comments.js';

/** @import {GroupRow} from '../api/types.js' */

const GLYPHS = /** @type {Record<string, string>} */ ({
	unreviewed: '○', accepted: '✓', rejected: '✗', deferred: '…', flagged: '!', stale: '↻',
});

/** What the pill says: the verdict, or that an unreviewed group needs a look. @param {GroupRow} row */
function statusOf(row) {
	if (row.stale) return { status: 'stale', text: `${row.status}, stale` };
	if (row.status === 'unreviewed' && row.findings.length > 0) return { status: 'flagged', text: 'flagged' };
	// Annotations that agree settle what is drawn; the verdict is still somebody's.
	if (row.status === 'unreviewed' && row.annotations === 'agreed') return { status: 'unreviewed', text: 'agreed, no verdict' };
	return { status: row.status, text: row.status };
}

/** @param {GroupRow} row */
function gateOf(row) {
	if (row.passes === null) return { title: 'not solved yet', detail: '' };
	if (!row.first_failing) return { title: 'passes', detail: '' };
	const { gate, sentence } = row.first_failing;
	return { title: GATE_TITLES[gate] ?? words(gate), detail: sentence };
}

/** Why it was rejected, or accepted all the same, and who decided where that is not the only person. @param {GroupRow} row */
function whyAndWho(row) {
	if (row.status === 'unreviewed') return '';
	const override = row.override ? `although ${(GATE_TITLES[row.override] ?? words(row.override)).toLowerCase()}` : '';
	const who = row.reviewer && row.reviewer !== 'local' ? row.reviewer : '';
	return [reasonText(row.reason ? { reason: row.reason, note: null } : null), override, row.fixed ? 'fixed' : '', who].filter(Boolean).join(' · ');
}

const CAME_TO = { agreed: 'agree', open: 'differ', decided: 'differed' };

/** How many people annotated it on their own, and what that came to. @param {{row: GroupRow}} props */
function OwnAnnotations({ row }) {
	if (!row.submissions) return null;
	const text = row.annotations ? `${row.submissions} ${CAME_TO[row.annotations]}` : row.submissions === 1 ? '1 annotation' : `${row.submissions} annotations`;
	const open = row.annotations === 'agreed' && row.status === 'unreviewed' ? '; they agree and the first one is used, but the group has no verdict yet' : '';
	const title = `${row.submissions === 1 ? 'One person has' : `${row.submissions} people have`} submitted an independent annotation${row.annotations === 'open' ? '; they differ, and a reviewer has to decide' : open}`;
	if (row.annotations !== 'open') return html`<span class="own-annotations" title=${title}>${text}</span>`;
	return html`<a class="own-annotations" data-state="open" href=${`/adjudicate/${row.id}`} tabindex="-1" title=${title}>${text}</a>`;
}

/** @param {{row: GroupRow, index: number, active: boolean, ticked: boolean}} props */
function Tick({ row, index, active, ticked }) {
	/** @param {MouseEvent} event */
	async function turn(event) {
		const box = /** @type {HTMLInputElement} */ (event.currentTarget);
		if (event.shiftKey) await tickTo(index);
		else turnTick(index);
		// The browser has turned it; a range may say otherwise.
		box.checked = isTicked(ticks.value, row.id);
	}
	return html`
		<div role="gridcell" class="queue-cell queue-cell--tick">
			<label class="tick" onMouseDown=${(/** @type {MouseEvent} */ event) => { if (event.shiftKey) event.preventDefault(); }}>
				<input type="checkbox" checked=${ticked} tabindex=${active ? 0 : -1} aria-label=${`Tick group ${row.number}`} onClick=${turn} />
			</label>
		</div>
	`;
}

/** @param {{row: GroupRow, index: number, q: string, painted: boolean, active: boolean, ticked: boolean}} props */
function Cells({ row, index, q, painted, active, ticked }) {
	const { status, text } = statusOf(row);
	const { title, detail } = gateOf(row);
	return html`
		<${Tick} row=${row} index=${index} active=${active} ticked=${ticked} />
		<div role="gridcell" class="queue-cell">
			<span class="thumbnail">${row.thumbnail ? html`<img src=${row.thumbnail} alt="" loading="lazy" decoding="async" width="104" height="58" />` : row.pictures ? 'no frame' : ''}${row.pictures ? null : html`<span class="pill" data-status="no-picture">no picture</span>`}</span>
		</div>
		<div role="gridcell" class="queue-cell queue-cell--two">
			<a href=${reviewAddress(row.id, q)} tabindex=${active ? 0 : -1}>${row.number}</a>
			<span class="queue-cell__sub">${row.label}</span>
		</div>
		<div role="gridcell" class="queue-cell">
			<span class="pill" data-status=${status}><span aria-hidden="true">${GLYPHS[status] ?? ''}</span> ${text}</span>
			<span class="queue-cell__sub queue-cell__by"><${OwnAnnotations} row=${row} /><${OpenComments} count=${row.comments} />${whyAndWho(row)}</span>
		</div>
		<div role="gridcell" class="queue-cell queue-cell--two" data-passes=${row.passes === true}>
			<span>${title}</span><span class="queue-cell__sub">${detail}</span>
		</div>
		<div role="gridcell" class="queue-cell" data-numeric="true" data-short=${row.margin !== null && row.margin < 0}>${marginText(row.margin)}</div>
		<div role="gridcell" class="queue-cell" data-numeric="true">${fixed(row.min_jac, 2)}</div>
		${painted ? html`<div role="gridcell" class="queue-cell" data-numeric="true" data-number="agreement">${fixed(row.agreement, 2)}</div>` : null}
		<div role="gridcell" class="queue-cell" data-numeric="true">${pixels(row.error_px)}</div>
		<div role="gridcell" class="queue-cell" data-numeric="true">${fixed(row.sigma_m, 2)}</div>
		<div role="gridcell" class="queue-cell" data-numeric="true">${degrees(row.parallax_degrees)}</div>
		<div role="gridcell" class="queue-cell" data-numeric="true">${fixed(row.size_ratio, 2)}</div>
		<div role="gridcell" class="queue-cell" data-numeric="true">${row.views}</div>
		<div role="gridcell" class="queue-cell" data-narrow="true">${row.split || '–'}</div>
		<div role="gridcell" class="queue-cell"><span class="queue-cell__findings">${row.findings.map(words).join(', ')}</span></div>
	`;
}

/** What is not read yet, in the shape of what comes. */
function Waiting() {
	return html`
		<div role="gridcell" class="queue-cell"></div>
		<div role="gridcell" class="queue-cell"><span class="thumbnail thumbnail--waiting"></span></div>
		<div role="gridcell" class="queue-cell queue-cell--waiting"><span class="hidden-text">Loading</span></div>
		<div role="gridcell" class="queue-cell queue-cell--waiting" data-short="true"></div>
		<div role="gridcell" class="queue-cell queue-cell--waiting"></div>
	`;
}

/** @param {{row: GroupRow | null, index: number, start: number, q: string, painted: boolean, active: boolean, ticked: boolean}} props */
export function QueueRow({ row, index, start, q, painted, active, ticked }) {
	/** @param {MouseEvent} event */
	function open(event) {
		const pressed = event.target instanceof Element && event.target.closest('a, label, input');
		if (row && !pressed) navigate(reviewAddress(row.id, q));
	}
	return html`
		<div
			class="queue-row" role="row" aria-rowindex=${index + 2} aria-selected=${ticked} data-active=${active}
			tabindex=${active ? 0 : -1} style=${{ transform: `translateY(${start}px)` }}
			onFocusIn=${() => { activeRow.value = index; }} onClick=${open}
		>
			${row ? html`<${Cells} row=${row} index=${index} q=${q} painted=${painted} active=${active} ticked=${ticked} />` : html`<${Waiting} />`}
		</div>
	`;
}
