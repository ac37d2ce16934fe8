// @ts-check
/** A batch is given on to others, or gets another name or day. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { patchBatch } from '../../api/work.js';
import { useAttempt } from '../../lib/attempt.js';
import { FormDialog } from '../dialog.js';
import { FormError } from '../form_error.js';
import { PeopleChoice } from './people_choice.js';

/** @import {TeamBatchJson} from '../../api/work.js' */
/** @import {Chosen} from './people_choice.js' */

/** @param {{one: TeamBatchJson, onClose: () => void, onDone: () => void}} props */
export function ReassignDialog({ one, onClose, onDone }) {
	const { batch, gold_every: goldEvery } = one;
	const [people, setPeople] = useState(/** @type {Chosen} */ ({ annotator: batch.annotators, reviewer: batch.reviewers }));
	const { error, attempt } = useAttempt();
	/** @param {FormData} form */
	const send = (form) => attempt(patchBatch(batch.id, {
		name: String(form.get('name')), due: String(form.get('due') ?? '') || null,
		annotators: people.annotator, reviewers: people.reviewer, gold_every: Number(form.get('gold')) || null,
	}), () => { onClose(); onDone(); });
	return html`
		<${FormDialog} title=${`Reassign: ${batch.name}`} onClose=${onClose} onSubmit=${send} buttons=${html`<button class="button button--primary" type="submit">Save</button>`}>
			<p>${batch.kind === 'tracks' ? 'Tracks that already have a verdict keep it.' : 'Submitted and reviewed groups stay; a person who has a group open keeps it until they leave.'}</p>
			<div class="form__row"><label for="give-name">Name</label><input class="field" id="give-name" name="name" required maxlength="80" autocomplete="off" defaultValue=${batch.name} /></div>
			<div class="form__columns">
			<div class="form__row"><label for="give-due">Due</label><input class="field" id="give-due" name="due" type="date" defaultValue=${batch.due ?? ''} /></div>
			${batch.kind === 'tracks' ? null : html`<div class="form__row"><label for="give-gold">Gold groups: one in every N groups of an annotator</label><input class="field" id="give-gold" name="gold" type="number" min="1" max="1000" placeholder="none" defaultValue=${goldEvery ?? ''} /></div>`}
			</div>
			<${PeopleChoice} dataset=${batch.dataset} chosen=${people} choose=${setPeople} parts=${batch.kind === 'tracks' ? ['reviewer'] : undefined} />
			${error ? html`<${FormError} error=${error} />` : null}
		<//>
	`;
}
