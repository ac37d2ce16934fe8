// @ts-check
/** How a team works through its batches: for leads. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { deleteBatch, getTeamWork, patchBatch } from '../../api/work.js';
import { useAttempt } from '../../lib/attempt.js';
import { fixed, plural } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { address } from '../../lib/router.js';
import { queueAddress } from '../../state/navigation.js';
import { whyNot } from '../../state/rights.js';
import { pageAddress } from '../dataset_menu.js';
import { FormError } from '../form_error.js';
import { Trouble } from '../page_frame.js';
import { Term } from '../term.js';
import { When } from '../when.js';
import { ConfirmButton } from '../confirm_button.js';
import { ReassignDialog } from './reassign_dialog.js';
import { Due, Progress } from './parts.js';

/** @import {DatasetJson} from '../../api/types.js' */
/** @import {PaceJson, TeamBatchJson} from '../../api/work.js' */

/** @param {{people: PaceJson[], name: string}} props */
function Paces({ people, name }) {
	if (people.length === 0) return null;
	return html`
		<div class="table__scroll"><table class="table">
			<caption class="hidden-text">Progress of each person in ${name}</caption>
			<thead><tr><th>Name</th><th>Submitted</th><th>Reviewed</th><th title="Time between actions; pauses of more than ten minutes do not count">Minutes</th><th>Minutes a group</th><th>Groups an hour</th></tr></thead>
			<tbody>${people.map((one) => html`
				<tr key=${one.name}><th scope="row">${one.name}</th><td>${one.submitted}</td><td>${one.judged}</td><td>${fixed(one.minutes, 0)}</td><td>${fixed(one.minutes_a_group, 1)}</td><td>${fixed(one.groups_an_hour, 0)}</td></tr>`)}
			</tbody>
		</table></div>
	`;
}

/** @param {{one: TeamBatchJson, act: (doing: Promise<unknown>) => void, give: (one: TeamBatchJson) => void}} props */
function TeamBatch({ one, act, give }) {
	const { batch, gold_every: goldEvery, here, stalled, people } = one;
	const open = batch.state === 'open';
	const several = batch.verdicts > 1 ? html` · ${batch.verdicts} people annotate each group: <a class="link" href=${pageAddress(batch.dataset, 'agreement')}>agreement</a>` : null;
	const given = [batch.annotators.length ? `annotate: ${batch.annotators.join(', ')}` : '', `review: ${batch.reviewers.join(', ') || 'all reviewers'}`].filter(Boolean).join(' · ');
	return html`
		<li class="work__item">
			<div class="work__head">
				<div>
					<h3><a class="link" href=${batch.kind === 'tracks' ? address(pageAddress(batch.dataset, 'tracks'), { batch: String(batch.id) }) : queueAddress(batch.dataset, `batch:${batch.id}`)}>${batch.name}</a>${open ? null : html` <span class="pill">closed</span>`}${stalled ? html` <span class="pill" data-status="rejected">stalled</span>` : null}</h3>
					<${Progress} batch=${batch} />
					<p class="note">${given}${several}${goldEvery ? ` · one gold group in ${goldEvery}` : ''}${here.length ? ` · active now: ${here.map(({ person }) => person).join(', ')}` : ''}${stalled ? html` · no activity since <${When} at=${stalled} />` : null}<${Due} due=${batch.due} /></p>
				</div>
				<span class="table__actions">
					<button class=${stalled ? 'button button--small button--primary' : 'button button--small'} type="button" onClick=${() => give(one)}>Reassign…<span class="hidden-text"> ${batch.name}</span></button>
					<button class="button button--small" type="button" onClick=${() => act(patchBatch(batch.id, { state: open ? 'closed' : 'open' }))}>${open ? 'Close' : 'Open again'}<span class="hidden-text"> ${batch.name}</span></button>
					<${ConfirmButton} label="Delete" question="Really delete?" what=${batch.name} small=${true} run=${() => act(deleteBatch(batch.id))} />
				</span>
			</div>
			<${Paces} people=${people} name=${batch.name} />
		</li>
	`;
}

/** @param {{dataset: DatasetJson, changed: () => void}} props */
export function TeamCard({ dataset, changed }) {
	const may = whyNot('lead', dataset.name) === '';
	const found = useResource(async (signal) => (may ? getTeamWork(dataset.id, signal) : null), [dataset.id, may]);
	const [giving, setGiving] = useState(/** @type {TeamBatchJson | null} */ (null));
	const { error, attempt } = useAttempt();
	const renew = () => { found.reload(); changed(); };
	/** @param {Promise<unknown>} doing */
	const act = (doing) => attempt(doing).then(renew);
	if (found.error) return html`<${Trouble} title="The batches cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (!may || !found.value) return null;
	const { items } = found.value;
	return html`
		<section class="card" aria-labelledby="team-title">
			<h2 id="team-title"><${Term} word="batch">Batches<//> of ${dataset.name}</h2>
			<p class="note">${items.length ? plural(items.length, 'batch').replace('batchs', 'batches') : 'None yet'}. Filter or tick groups in the <a class="link" href=${queueAddress(dataset.name, '')}>queue</a> and press “Assign…” to make one.</p>
			${error ? html`<${FormError} error=${error} />` : null}
			<ul class="work__list">${items.map((one) => html`<${TeamBatch} key=${one.batch.id} one=${one} act=${act} give=${setGiving} />`)}</ul>
			${giving ? html`<${ReassignDialog} one=${giving} onClose=${() => setGiving(null)} onDone=${renew} />` : null}
		</section>
	`;
}
