// @ts-check
/** One verdict for everything that matches: first what would happen, then done, and taken back in one go. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { postVerdicts, previewVerdicts, undoVerdicts } from '../api/queue.js';
import { count, words } from '../lib/format.js';
import { sentenceOf, useResource } from '../lib/resource.js';
import { loadDatasets } from '../state/datasets.js';
import { reviewAddress } from '../state/navigation.js';
import { complain, inform } from '../state/notice.js';
import { openQueue } from '../state/queue.js';
import { REASONS } from '../state/verdicts.js';
import { FormDialog } from './dialog.js';

/** @import {BulkPreview, BulkRequest, BulkResult} from '../api/queue.js' */
/** @import {DatasetJson} from '../api/types.js' */

const STATES = [
	{ state: 'accepted', verb: 'Accept', note: 'they may enter a version' },
	{ state: 'rejected', verb: 'Reject', note: 'they stay out, with a reason' },
	{ state: 'deferred', verb: 'Defer', note: 'somebody comes back to them' },
	{ state: 'unreviewed', verb: 'Withdraw', note: 'as if nobody had decided' },
];

/** Why a group is left alone. */
const REFUSALS = /** @type {{[reason: string]: string}} */ ({ unsolved: 'nobody has solved them yet', needs_note: 'they fail a gate, and accepting that needs a note' });

/** The queue and its numbers as they are now. @param {DatasetJson} dataset @param {string} q */
function readAgain(dataset, q) {
	loadDatasets();
	openQueue(dataset, q);
}

/** @param {DatasetJson} dataset @param {string} q @param {BulkResult} done @param {string} state */
function offerUndo(dataset, q, done, state) {
	const { batch } = done;
	async function undo() {
		if (batch === null) return;
		try {
			const { restored, kept } = await undoVerdicts(batch);
			inform(`${count(restored)} verdicts are taken back.${kept ? ` ${count(kept)} groups were judged since and stay.` : ''}`);
		} catch (error) {
			complain(sentenceOf(error));
		}
		readAgain(dataset, q);
	}
	const refused = done.refused.reduce((sum, { groups }) => sum + groups, 0);
	const rest = refused ? ` ${count(refused)} stay as they were.` : '';
	inform(`${count(done.changed)} groups ${state}.${rest}`, batch === null ? undefined : { label: 'Undo', run: undo });
}

/** @param {{preview: BulkPreview, q: string}} props */
function Outcome({ preview, q }) {
	return html`
		<div class="bulk__outcome" role="status">
			<p><strong>${count(preview.would_change)}</strong> of ${count(preview.matches)} groups change.</p>
			${preview.refused.length ? html`
				<ul class="bulk__refused">${preview.refused.map(({ reason, groups }) => html`
					<li key=${reason}><span data-grade="warn">${count(groups)} stay as they are:</span> ${REFUSALS[reason] ?? words(reason)}</li>`)}
				</ul>` : null}
			${preview.sample.length ? html`
				<p class="note">For example</p>
				<ul class="bulk__sample">${preview.sample.slice(0, 5).map(({ id, key }) => html`
					<li key=${id}><a href=${reviewAddress(id, q)} target="_blank">${key}</a></li>`)}
				</ul>` : null}
		</div>
	`;
}

/** @param {{ask: BulkRequest, change: (values: Partial<BulkRequest>) => void}} props */
function Fields({ ask, change }) {
	const value = (/** @type {Event} */ event) => /** @type {HTMLInputElement} */ (event.target).value;
	const notes = /** @type {{[state: string]: string}} */ ({
		accepted: 'Note, needed to accept groups that fail a gate', rejected: 'Note', deferred: 'Note', unreviewed: 'Note',
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
				<select class="field" id="bulk-reason" value=${ask.reason} onChange=${(/** @type {Event} */ event) => change({ reason: value(event) })}>
					${REASONS.map(({ name, label }) => html`<option key=${name} value=${name}>${label.replace('…', '')}</option>`)}
				</select>
			</div>` : null}
		<div class="form__row">
			<label for="bulk-note">${notes[ask.state]}</label>
			<input class="field" id="bulk-note" maxlength="500" autocomplete="off" defaultValue="" onChange=${(/** @type {Event} */ event) => change({ note: value(event).trim() || null })} />
		</div>
	`;
}

/** @param {{dataset: DatasetJson, q: string, onClose: () => void}} props */
export function BulkDialog({ dataset, q, onClose }) {
	const [ask, setAsk] = useState(/** @type {BulkRequest} */ ({ q, state: 'accepted', reason: null, note: null }));
	const [state, setState] = useState({ busy: '', error: '' });
	const { state: verdict, reason, note } = ask;
	const preview = useResource((signal) => previewVerdicts(dataset.id, ask, signal), [verdict, reason, note]);
	const would = preview.value?.would_change ?? 0;
	const { verb } = STATES.find((one) => one.state === verdict) ?? STATES[0];
	const why = state.busy ? 'Under way' : preview.error ? sentenceOf(preview.error) : would === 0 ? 'Nothing would change' : '';
	async function send() {
		if (why) return;
		setState({ busy: 'Deciding…', error: '' });
		try {
			const done = await postVerdicts(dataset.id, { ...ask, expected: would });
			offerUndo(dataset, q, done, verdict);
			readAgain(dataset, q);
			onClose();
		} catch (error) {
			setState({ busy: '', error: sentenceOf(error) });
		}
	}
	return html`
		<${FormDialog}
			title="Decide all groups that match" onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${state.busy || `${verb} ${count(would)} groups`}</button>`}
		>
			<p>Query: <code>${q || 'every group'}</code></p>
			<${Fields} ask=${ask} change=${(/** @type {Partial<BulkRequest>} */ values) => setAsk({ ...ask, ...values })} />
			${preview.value ? html`<${Outcome} preview=${preview.value} q=${q} />` : preview.error ? null : html`<p class="empty-note" role="status">Counting…</p>`}
			${state.error || preview.error ? html`<p class="form__error" role="alert">${state.error || sentenceOf(preview.error)}</p>` : null}
		<//>
	`;
}
