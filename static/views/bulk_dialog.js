// @ts-check
/** One verdict for the ticked rows, or for all that match: first what would happen, then done in one go. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { ApiError, sentenceOf } from '../api/problem.js';
import { postVerdicts, previewVerdicts } from '../api/queue.js';
import { withValue } from '../lib/field.js';
import { count, plural } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { reviewAddress } from '../state/navigation.js';
import { readAgain, announceBatch, whyUnchanged } from '../state/queue_batches.js';
import { clearTicks } from '../state/queue_ticks.js';
import { REASONS } from '../state/reasons.js';
import { FormDialog } from './dialog.js';

/** @import {BulkPreview, BulkRequest} from '../api/queue.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** @typedef {{count: number, q: string} | null} Ticked   what is ticked, and the query that finds it */

const STATES = [
	{ state: 'accepted', verb: 'Accept', note: 'can be part of a version' },
	{ state: 'rejected', verb: 'Reject', note: 'left out of versions, with a reason' },
	{ state: 'deferred', verb: 'Defer', note: 'to be reviewed later' },
	{ state: 'unreviewed', verb: 'Withdraw', note: 'remove the verdict' },
];

/** @param {{preview: BulkPreview, state: string, q: string, ticked: number}} props `ticked`: rows that are asked about one by one; 0: none are */
function Outcome({ preview, state: verdict, q, ticked }) {
	const lost = verdict === 'unreviewed' ? 'removed' : 'replaced';
	const gone = Math.max(ticked - preview.matches, 0);
	return html`
		<div role="status">
			<p><strong>${count(preview.would_change)}</strong> of ${plural(preview.matches, 'group')} ${preview.would_change === 1 ? 'changes' : 'change'}.</p>
			${preview.replaced.map(({ state, groups }) => html`
				<p key=${state}><span data-grade="warn">${count(groups)} ${groups === 1 ? 'is' : 'are'} ${state} now;</span> ${groups === 1 ? `its verdict is ${lost}` : `their verdicts are ${lost}`}.</p>`)}
			${preview.unchanged ? html`<p>${plural(preview.unchanged, 'group')} ${preview.unchanged === 1 ? 'has' : 'have'} ${verdict === 'unreviewed' ? 'no verdict' : 'this verdict already'}.</p>` : null}
			${gone ? html`<p><span data-grade="warn">${plural(gone, 'ticked group')} not changed:</span> no longer in this list, for example because somebody reviewed ${gone === 1 ? 'it' : 'them'} meanwhile</p>` : null}
			${preview.refused.length ? html`
				<ul class="bulk__refused">${preview.refused.map(({ reason, groups }) => html`
					<li key=${reason}><span data-grade="warn">${plural(groups, 'group')} not changed:</span> ${whyUnchanged(reason, groups)}</li>`)}
				</ul>` : null}
			${preview.sample.length ? html`
				<p class="note">For example</p>
				<ul class="bulk__sample">${preview.sample.slice(0, 5).map(({ id, key, number, label }) => html`
					<li key=${id}><a href=${reviewAddress(id, q)} target="_blank" title=${key}>${number} · ${label}</a></li>`)}
				</ul>` : null}
		</div>
	`;
}

/** @param {{ask: Omit<BulkRequest, 'q'>, change: (values: Partial<BulkRequest>) => void}} props */
function Fields({ ask, change }) {
	const notes = /** @type {{[state: string]: string}} */ ({
		accepted: 'Note, needed to accept groups that fail a gate or have no picture', rejected: 'Note', deferred: 'Note', unreviewed: 'Note',
	});
	return html`
		<fieldset class="choice choice--row">
			<legend>Verdict</legend>
			${STATES.map(({ state, verb, note }) => html`
				<label key=${state}>
					<input type="radio" name="state" checked=${ask.state === state} onChange=${() => change({ state, reason: state === 'rejected' ? REASONS[0].name : null })} />
					<span>${verb}<small>${note}</small></span>
				</label>`)}
		</fieldset>
		${ask.state === 'rejected' ? html`
			<div class="form__row">
				<label for="bulk-reason">Reason</label>
				<select class="field" id="bulk-reason" value=${ask.reason} onChange=${withValue((reason) => change({ reason }))}>
					${REASONS.map(({ name, label }) => html`<option key=${name} value=${name}>${label.replace('…', '')}</option>`)}
				</select>
			</div>` : null}
		<div class="form__row">
			<label for="bulk-note">${notes[ask.state]}</label>
			<input class="field" id="bulk-note" maxlength="500" autocomplete="off" defaultValue="" onInput=${withValue((note) => change({ note: note.trim() || null }))} />
		</div>
	`;
}

/**
 * Which groups: those ticked, or all that match.
 *
 * @param {{q: string, total: number, ticked: Ticked, chosen: boolean, choose: (ticked: boolean) => void}} props
 */
function Which({ q, total, ticked, chosen, choose }) {
	const query = html`<code>${q || 'every group'}</code>`;
	if (!ticked) return html`<p>Query: ${query}</p>`;
	return html`
		<fieldset class="choice choice--row">
			<legend>Groups</legend>
			<label>
				<input type="radio" name="which" checked=${chosen} onChange=${() => choose(true)} />
				<span>${count(ticked.count)} ticked<small>the groups ticked in the list</small></span>
			</label>
			<label>
				<input type="radio" name="which" checked=${!chosen} onChange=${() => choose(false)} />
				<span>All ${count(total)} that match<small>${query}</small></span>
			</label>
		</fieldset>
	`;
}

/** @param {{dataset: DatasetJson, q: string, total: number, ticked: Ticked, onClose: () => void}} props */
export function BulkDialog({ dataset, q, total, ticked, onClose }) {
	const [ask, setAsk] = useState(/** @type {Omit<BulkRequest, 'q'>} */ ({ state: 'accepted', reason: null, note: null }));
	const [chosen, choose] = useState(ticked !== null);
	const [state, setState] = useState({ busy: '', error: '' });
	const { state: verdict, reason, note } = ask;
	const asked = chosen && ticked ? ticked.q : q;
	// What a note says changes nothing about who is counted, only that there is one.
	const preview = useResource((signal) => previewVerdicts(dataset.id, { q: asked, ...ask }, signal), [asked, verdict, reason, note === null]);
	const would = preview.value?.would_change ?? 0;
	const { verb } = STATES.find((one) => one.state === verdict) ?? STATES[0];
	const why = state.busy ? 'Under way' : preview.error ? sentenceOf(preview.error)
		: preview.waiting ? 'Counting' : would === 0 ? 'Nothing would change' : '';
	async function send() {
		if (why) return;
		setState({ busy: 'Saving the verdicts…', error: '' });
		try {
			announceBatch(await postVerdicts(dataset.id, { q: asked, ...ask, expected: would }), verdict, dataset.name);
			onClose();
			if (chosen) clearTicks();
			readAgain();
		} catch (error) {
			setState({ busy: '', error: sentenceOf(error) });
			// Somebody was faster: what would happen now is shown, and may be done.
			if (error instanceof ApiError && error.status === 409) preview.reload();
		}
	}
	return html`
		<${FormDialog}
			title="One verdict for many groups" onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${state.busy || `${verb} ${plural(would, 'group')}`}</button>`}
		>
			<${Which} q=${q} total=${total} ticked=${ticked} chosen=${chosen} choose=${choose} />
			<${Fields} ask=${ask} change=${(/** @type {Partial<BulkRequest>} */ values) => setAsk({ ...ask, ...values })} />
			<div class="bulk__outcome">
				${preview.value ? html`<${Outcome} preview=${preview.value} state=${verdict} q=${q} ticked=${chosen && ticked ? ticked.count : 0} />` : preview.error ? null : html`<p role="status">Counting…</p>`}
				${state.error || preview.error ? html`<p class="form__error" role="alert">${state.error || sentenceOf(preview.error)}</p>` : null}
			</div>
		<//>
	`;
}
