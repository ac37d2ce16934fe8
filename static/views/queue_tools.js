// @ts-check
/** Between histograms and rows: which states, saved views, and verdicts on everything that matches. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { withValue } from '../lib/field.js';
import { count } from '../lib/format.js';
import { useKeys } from '../lib/hooks.js';
import { valueOf, withField, wordsOf } from '../state/query.js';
import { redo, redoable, undo, undoable } from '../state/undo.js';
import { isTeam, myName } from '../state/me.js';
import { queue, statusCounts } from '../state/queue.js';
import { clearTicks, countOf, queryOf, ticks } from '../state/queue_ticks.js';
import { whyNot } from '../state/rights.js';
import { BulkDialog } from './bulk_dialog.js';
import { HIDDEN_WHY } from './queue_empty.js';
import { Reviewers } from './reviewers.js';
import { SavedViews } from './saved_views.js';
import { BatchDialog } from './work/batch_dialog.js';
import { VALUE_OF_REVIEW, ValueOfReview } from './value_of_review.js';

/** @import {DatasetJson} from '../api/types.js' */

const STATUSES = [
	{ name: 'unreviewed', glyph: '○' }, { name: 'accepted', glyph: '✓' },
	{ name: 'rejected', glyph: '✗' }, { name: 'deferred', glyph: '…' },
];
const FLAGS = [
	{ word: 'finding:any', label: 'with findings' }, { word: 'passes:no', label: 'failing' },
	{ word: 'stale:yes', label: 'stale' }, { word: 'comments:open', label: 'with comments' },
];
const ORDERS = [
	{ sort: '', label: 'Order of the dataset', title: 'As the groups were imported' }, { sort: 'value', label: 'Value of review', title: VALUE_OF_REVIEW },
	{ sort: 'sigma-desc', label: 'Largest σ first', title: 'The least certain ball positions come first' }, { sort: 'newest', label: 'Newest change first', title: 'The groups whose annotations changed last come first; verdicts do not count' },
];

/** @param {{dataset: string, q: string, onQuery: (q: string) => void}} props */
function Facets({ dataset, q, onQuery }) {
	const chosen = valueOf(q, 'status').split(',').filter(Boolean);
	const counts = statusCounts.value;
	const words = wordsOf(q);
	const judges = isTeam && !whyNot('review', dataset);
	const flags = [...FLAGS, ...(myName.value ? [{ word: `mentions:${myName.value}`, label: 'mentions me' }] : []), ...(judges ? [{ word: 'annotations:waiting', label: 'to decide' }] : [])];
	/** @param {string} name */
	function turn(name) {
		const next = chosen.includes(name) ? chosen.filter((one) => one !== name) : [...chosen, name];
		onQuery(withField(q, 'status', next.length ? [`status:${next.join(',')}`] : []));
	}
	/** @param {string} word */
	function turnFlag(word) {
		onQuery((words.includes(word) ? words.filter((one) => one !== word) : [...words, word]).join(' '));
	}
	return html`
		<div class="facets" role="group" aria-label="Filters">
			${STATUSES.map(({ name, glyph }) => html`
				<button key=${name} class="facet" type="button" data-status=${name} aria-pressed=${chosen.includes(name)} onClick=${() => turn(name)}>
					<span aria-hidden="true">${glyph}</span> ${name} <span class="facet__count">${counts ? count(counts[name] ?? 0) : ''}</span>
				</button>`)}
			${flags.map(({ word, label }) => html`
				<button key=${word} class="facet" type="button" aria-pressed=${words.includes(word)} onClick=${() => turnFlag(word)}>${label}</button>`)}
		</div>
	`;
}

/** @param {{q: string, onQuery: (q: string) => void}} props */
function OrderChoice({ q, onQuery }) {
	const sort = valueOf(q, 'sort');
	const known = ORDERS.some((order) => order.sort === sort);
	const choose = withValue((value) => onQuery(withField(q, 'sort', value ? [`sort:${value}`] : [])));
	return html`
		<select class="field field--select" aria-label="Order" aria-describedby=${sort.startsWith('value') ? 'order-explained' : undefined} title=${ORDERS.find((order) => order.sort === sort)?.title} value=${sort} onChange=${choose}>
			${ORDERS.map((order) => html`<option key=${order.sort} value=${order.sort} title=${order.title}>${order.label}</option>`)}
			${known ? null : html`<option value=${sort}>By ${sort.replace('-desc', ', descending')}</option>`}
		</select>
	`;
}

/** How many rows are ticked, and the way to none. @param {{ticked: number}} props */
function Ticked({ ticked }) {
	return html`
		<span class="ticked" role="status">${ticked > 0 ? html`<strong>${count(ticked)}</strong> ticked` : null}</span>
		${ticked > 0 ? html`<button class="button" type="button" onClick=${clearTicks}>Clear<span class="hidden-text"> the ticks</span></button>` : null}
	`;
}

function UndoButton() {
	const what = undoable.value;
	return html`
		<button class="icon-button" type="button" aria-label="Undo" aria-disabled=${what === null} title=${`${what ?? 'Nothing to undo'} (Ctrl Z)`} onClick=${undo}>
			<svg viewBox="0 0 16 16" aria-hidden="true"><path d="M6 3 3 6l3 3M3 6h6a4 4 0 0 1 0 8H6" /></svg>
		</button>
	`;
}

function RedoButton() {
	const what = redoable.value;
	return html`
		<button class="icon-button" type="button" aria-label="Redo" aria-disabled=${what === null} title=${`${what ?? 'Nothing to redo'} (Ctrl Shift Z)`} onClick=${redo}>
			<svg viewBox="0 0 16 16" aria-hidden="true"><path d="m10 3 3 3-3 3M13 6H7a4 4 0 0 0 0 8h3" /></svg>
		</button>
	`;
}

/** @param {{dataset: DatasetJson, q: string, onQuery: (q: string) => void}} props */
export function QueueTools({ dataset, q, onQuery }) {
	const [deciding, setDeciding] = useState(false);
	const [giving, setGiving] = useState(false);
	const { total, loaded, error } = queue.value;
	const ticked = countOf(ticks.value, total);
	const reason = !loaded || error ? 'The query is still running' : total === 0 ? 'No group matches' : '';
	const open = () => { if (!reason) setDeciding(true); };
	const give = () => { if (!reason) setGiving(true); };
	const [keys] = useState(() => ({ run: open, give }));
	keys.run = open;
	keys.give = give;
	const [bindings] = useState(() => [
		{ keys: ['b'], label: 'Set a verdict on the ticked groups, or on all that match', group: 'Queue', run: () => keys.run() },
		{ keys: ['Shift+d'], label: 'Assign the ticked groups, or all that match, as a batch', group: 'Queue', needs: /** @type {const} */ ('lead'), run: () => keys.give() },
		{ keys: ['Ctrl+z'], label: 'Undo the last verdict, of one group or of many', group: 'Queue', run: undo },
		{ keys: ['Ctrl+Shift+z', 'Ctrl+y'], label: 'Redo the verdict that was undone last', group: 'Queue', run: redo },
	]);
	useKeys(bindings);
	return html`
		<div class="queue-tools">
			<${Facets} dataset=${dataset.name} q=${q} onQuery=${onQuery} />
			<${OrderChoice} q=${q} onQuery=${onQuery} />
			<${SavedViews} dataset=${dataset} q=${q} onQuery=${onQuery} />
			<${Reviewers} dataset=${dataset} onQuery=${onQuery} />
			<${UndoButton} />
			<${RedoButton} />
			<${Ticked} ticked=${ticked} />
			${whyNot('lead', dataset.name) ? null : html`<button class="button" type="button" aria-disabled=${reason !== ''} title=${reason || 'Make a batch of these groups for people to work on (Shift D)'} onClick=${give}>Assign…</button>`}
			<button data-needs="review" class=${ticked > 0 ? 'button button--primary' : 'button'} type="button" aria-disabled=${reason !== ''} title=${reason} onClick=${open}>
				${reason ? 'Verdict…' : ticked > 0 ? `Verdict on ${count(ticked)} ticked…` : `Verdict on all ${count(total)}…`}
			</button>
			<${ValueOfReview} q=${q} />
			${dataset.hides_groups && !error && total > 0 ? html`<p class="queue-tools__order" data-hidden-groups>${HIDDEN_WHY}</p>` : null}
			${giving ? html`
				<${BatchDialog}
					dataset=${dataset} q=${q} total=${total} onClose=${() => setGiving(false)}
					ticked=${ticked > 0 ? { count: ticked, q: queryOf(ticks.value, q) } : null}
				/>` : null}
			${deciding ? html`
				<${BulkDialog}
					dataset=${dataset} q=${q} total=${total} onClose=${() => setDeciding(false)}
					ticked=${ticked > 0 ? { count: ticked, q: queryOf(ticks.value, q) } : null}
				/>` : null}
		</div>
	`;
}
