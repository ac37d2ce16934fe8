// @ts-check
/** What is filtered or ticked in the queue becomes a batch that people work on. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { postGold } from '../../api/independent_annotations.js';
import { getVersions } from '../../api/versions.js';
import { postBatch } from '../../api/work.js';
import { useAttempt } from '../../lib/attempt.js';
import { withValue } from '../../lib/field.js';
import { count, plural } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { navigate } from '../../lib/router.js';
import { inform } from '../../state/notice.js';
import { withField, wordsOf } from '../../state/query.js';
import { clearTicks } from '../../state/queue_ticks.js';
import { FormDialog } from '../dialog.js';
import { FormError } from '../form_error.js';
import { STARTS } from '../gold_card.js';
import { PeopleChoice } from './people_choice.js';

/** @import {DatasetJson} from '../../api/types.js' */
/** @import {Chosen} from './people_choice.js' */

/** @param {FormData} form @param {string} name */
const textOf = (form, name) => String(form.get(name) ?? '').trim();

/** The ticked rows in the order of the list. @param {string} ticked @param {string} q */
function inOrder(ticked, q) {
	const order = wordsOf(q).filter((word) => word.startsWith('sort:'));
	return withField(ticked, 'sort', order);
}

/** Who knows the truth of gold groups; null: leads, who marked them. @param {string} said @returns {{source: 'sample' | 'version', version?: string} | null} */
function sourceOf(said) {
	if (said === 'sample') return { source: 'sample' };
	return said.startsWith('v:') ? { source: 'version', version: said.slice(2) } : null;
}

/** Gold groups: how many, whose truth, and what people begin with. @param {{dataset: DatasetJson}} props */
function GoldFields({ dataset }) {
	const [some, setSome] = useState(false);
	const versions = useResource(async (signal) => (some ? getVersions(dataset.id, signal) : null), [dataset.id, some]);
	return html`
		<div class="form__row"><label for="batch-gold">Gold groups: one in every N groups of an annotator</label><input class="field" id="batch-gold" name="gold" type="number" min="1" max="1000" placeholder="none" onInput=${withValue((text) => setSome(text !== ''))} /></div>
		${some ? html`
			<div class="form__row"><label for="batch-truth">Use as gold groups</label><select class="field" id="batch-truth" name="truth">
				<option value="">groups that leads marked as gold</option>
				<option value="sample">also groups of a sample, whose cameras and ball are known</option>
				${versions.value?.items.map(({ name }) => html`<option key=${name} value=${`v:${name}`}>also groups of ${name} on which annotators agreed</option>`)}
			</select></div>
			<div class="form__row"><label for="batch-start">A copy of a gold group starts with</label><select class="field" id="batch-start" name="start">
				${STARTS.map(([name, words]) => html`<option key=${name} value=${name}>${words}</option>`)}
			</select></div>` : null}
	`;
}

/** @param {{dataset: DatasetJson, q: string, total: number, ticked: {count: number, q: string} | null, onClose: () => void}} props */
export function BatchDialog({ dataset, q, total, ticked, onClose }) {
	const [people, setPeople] = useState(/** @type {Chosen} */ ({ annotator: [], reviewer: [] }));
	const { error, busy, attempt } = useAttempt();
	const matching = ticked?.count ?? total;
	/** @param {FormData} form */
	function send(form) {
		if (busy) return;
		const known = sourceOf(textOf(form, 'truth')), goldEvery = Number(textOf(form, 'gold')) || null;
		const first = known && goldEvery ? postGold(dataset.id, { ...known, start: textOf(form, 'start') }) : Promise.resolve();
		attempt(first.then(() => postBatch(dataset.id, {
			name: textOf(form, 'name'), q: ticked ? inOrder(ticked.q, q) : q, size: Number(textOf(form, 'size')) || null,
			annotators: people.annotator, reviewers: people.reviewer, due: textOf(form, 'due') || null, skip_given: form.has('skip'),
			verdicts: Number(textOf(form, 'verdicts')) || 1, blind: form.has('blind'), gold_every: goldEvery,
		})), (made) => {
			clearTicks();
			onClose();
			inform(`Batch “${made.name}” created with ${plural(made.groups, 'group')}.`, { label: 'See the work', run: () => navigate('/work') });
		});
	}
	return html`
		<${FormDialog}
			title="Assign groups" onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${busy}>Assign</button>`}
		>
			<p>${ticked ? html`${count(ticked.count)} ticked groups` : q ? html`${plural(total, 'group')} that match <code>${q}</code>` : html`All ${plural(total, 'group')} of ${dataset.name}`}, in the order of the list. Groups that match later are not added.</p>
			<div class="form__row"><label for="batch-name">Name</label><input class="field" id="batch-name" name="name" required maxlength="80" autocomplete="off" /></div>
			<div class="form__columns batch-dialog__fields">
			<div class="form__row"><label for="batch-size">Number of groups (the first of the list)</label><input class="field" id="batch-size" name="size" type="number" min="1" max="10000" placeholder=${`all ${count(matching)}`} /></div>
			<div class="form__row"><label for="batch-due">Due</label><input class="field" id="batch-due" name="due" type="date" /></div>
			<div class="form__row"><label for="batch-verdicts">Annotators per group</label><input class="field" id="batch-verdicts" name="verdicts" type="number" min="1" max="5" placeholder="1" /></div>
			<${GoldFields} dataset=${dataset} />
			</div>
			<label class="form__check"><input type="checkbox" name="blind" defaultChecked /> Annotators do not see each other’s work</label>
			<label class="form__check"><input type="checkbox" name="skip" defaultChecked /> Skip groups that are in another open batch</label>
			<${PeopleChoice} dataset=${dataset.name} chosen=${people} choose=${setPeople} />
			${error ? html`<${FormError} error=${error} />` : null}
		<//>
	`;
}
