// @ts-check
/** Making annotations of predictions: who accepts them says which, and sees how many. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { acceptPredictions } from '../../api/evaluations.js';
import { count, words } from '../../lib/format.js';
import { sentenceOf, useResource } from '../../lib/resource.js';
import { resultOf } from '../../state/jobs.js';
import { inform } from '../../state/notice.js';
import { FormDialog } from '../dialog.js';

/** @import {PredictionSet} from '../../api/evaluations.js' */
/** @import {DatasetJson} from '../../api/types.js' */

const valueOf = (/** @type {Event} */ event) => /** @type {HTMLInputElement} */ (event.target).value;

/** @param {{plan: any}} props */
function Plan({ plan }) {
	const refused = Object.entries(plan.refused ?? {});
	return html`
		<div class="bulk__outcome" role="status">
			<p><strong>${count(plan.changed)}</strong> views of ${count(plan.groups)} groups get a ball.</p>
			${refused.length ? html`<ul>${refused.map(([why, n]) => html`<li key=${why}>${count(Number(n))} stay as they are: ${words(why)}</li>`)}</ul>` : null}
		</div>
	`;
}

/** @param {{one: DatasetJson, set: PredictionSet, onClose: () => void}} props */
export function AcceptPredictions({ one, set, onClose }) {
	const [ask, setAsk] = useState({ q: 'gate:ball', min_score: 0.5, replace: false });
	const [state, setState] = useState({ busy: '', error: '' });
	const body = { dataset: one.name, predictions: set.id, ...ask };
	const plan = useResource((signal) => (signal.aborted ? Promise.resolve(null) : acceptPredictions({ ...body, dry_run: true })), [ask.q, ask.min_score, ask.replace]);
	const would = plan.value?.changed ?? 0;
	const why = state.busy ? 'Under way' : plan.error ? sentenceOf(plan.error) : would === 0 ? 'No view would get a ball' : '';
	async function send() {
		if (why) return;
		setState({ busy: 'Accepting…', error: '' });
		try {
			const done = await resultOf(await acceptPredictions({ ...body, dry_run: false }), (job) => setState({ busy: job.sentence || 'Accepting…', error: '' }));
			inform(`${count(done.changed)} views have a ball from ${set.name}. Each can be undone in its group.`);
			onClose();
		} catch (error) {
			setState({ busy: '', error: sentenceOf(error) });
		}
	}
	return html`
		<${FormDialog}
			title=${`Accept balls of ${set.name}`} onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${state.busy || `Accept ${count(would)}`}</button>`}
		>
			<p>The surest prediction of each view becomes its annotation, as an edit that can be undone.</p>
			<div class="form__row"><label for="accept-q">Groups, as a query of the queue</label><input class="field mono" id="accept-q" value=${ask.q} autocomplete="off" spellcheck=${false} onChange=${(/** @type {Event} */ event) => setAsk({ ...ask, q: valueOf(event) })} /></div>
			<div class="form__row"><label for="accept-score">Smallest score</label><input class="field" id="accept-score" type="number" min="0" max="1" step="0.05" value=${ask.min_score} onChange=${(/** @type {Event} */ event) => setAsk({ ...ask, min_score: Number(valueOf(event)) })} /></div>
			<label class="form__check"><input type="checkbox" checked=${ask.replace} onChange=${(/** @type {Event} */ event) => setAsk({ ...ask, replace: /** @type {HTMLInputElement} */ (event.target).checked })} />Also where the view has another ball</label>
			${plan.value ? html`<${Plan} plan=${plan.value} />` : null}
			${state.error || plan.error ? html`<p class="form__error" role="alert">${state.error || sentenceOf(plan.error)}</p>` : null}
		<//>
	`;
}
