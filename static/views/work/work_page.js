// @ts-check
/** My work: batches that are mine, and how the team works through its own. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { getTracks } from '../../api/tracks.js';
import { getMyWork } from '../../api/work.js';
import { useAttempt } from '../../lib/attempt.js';
import { plural } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { navigate } from '../../lib/router.js';
import { dataset, loadDatasets } from '../../state/datasets.js';
import { goOn } from '../../state/leases.js';
import { isTeam } from '../../state/me.js';
import { reviewAddress } from '../../state/navigation.js';
import { inform } from '../../state/notice.js';
import { trackAddress } from '../../state/track_list.js';
import { pageAddress } from '../dataset_menu.js';
import { FormError } from '../form_error.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { When } from '../when.js';
import { Due, Progress } from './parts.js';
import { TeamCard } from './team_card.js';

/** @import {BatchJson, MyBatchJson} from '../../api/work.js' */

/** Open the first track of a batch that nobody judged. @param {BatchJson} batch @returns {Promise<boolean>} whether there is one */
async function openTrack({ id, dataset: name }) {
	const { items } = await getTracks(name, { batch: id, verdict: 'none' });
	if (items[0]) navigate(trackAddress(items[0].id, { batch: String(id) }));
	return items.length > 0;
}

/** @param {{one: MyBatchJson, first: boolean}} props `first`: Enter goes on with it */
function MyBatch({ one: { batch, parts, left, returned: back, hides_groups: hides }, first }) {
	const button = useRef(/** @type {HTMLButtonElement | null} */ (null));
	const { error, attempt } = useAttempt();
	// Who is at something else already stays there; where another one becomes the first, nobody is taken to it.
	useEffect(() => { if (first && document.activeElement === document.body) button.current?.focus(); }, []);
	const tracks = batch.kind === 'tracks';
	const go = () => attempt(tracks ? openTrack(batch) : goOn(batch.id), (some) => {
		if (!some) inform(tracks ? `No track of “${batch.name}” is left.` : `No group of “${batch.name}” is available to you now: other people have the remaining groups open, or have to work on them first.`);
	});
	return html`
		<li class="work__item">
			<div class="work__head">
				<div>
					<h3>${batch.name}</h3>
					<${Progress} batch=${batch} />
					<p class="note">${batch.dataset} · you ${parts.map((part) => (part === 'annotator' ? 'annotate' : 'review')).join(' and ')}${batch.verdicts > 1 && parts.includes('reviewer') ? html` · <a class="link" href=${pageAddress(batch.dataset, 'agreement')}>decide where annotations differ</a>` : null}<${Due} due=${batch.due} /></p>
					${hides ? html`<p class="note" data-hidden-groups>You annotate copies of the groups. The groups themselves are hidden from you until this batch is closed.</p>` : null}
					${back.length ? html`<ul class="work__back" aria-label="Returned to you">${back.map((one) => html`
						<li key=${one.group}><a href=${reviewAddress(one.group, `batch:${batch.id}`)}>${one.title}</a> was returned by ${one.by}${one.reason ? html`: “${one.reason}”` : ''} <small><${When} at=${one.at} /></small></li>`)}</ul>` : null}
					${error ? html`<${FormError} error=${error} />` : null}
				</div>
				${left ? html`<button ref=${button} class=${first ? 'button button--primary' : 'button'} type="button" data-needs="annotate" onClick=${go}>Continue: ${plural(left, tracks ? 'track' : 'group')}<span class="hidden-text"> of ${batch.name}</span></button>` : null}
			</div>
		</li>
	`;
}

/** @param {{items: MyBatchJson[]}} props */
function Mine({ items }) {
	const first = items.findIndex(({ left }) => left > 0);
	return html`
		<section class="card" aria-labelledby="mine-title">
			<h2 id="mine-title">My batches</h2>
			${items.length ? null : html`<p>${isTeam ? 'No batch is assigned to you. A lead can assign one; or review groups from the queue.' : 'A batch is a set of groups to work through. Make one with Assign… in the queue.'}</p>`}
			<ul class="work__list">${items.map((one, index) => html`<${MyBatch} key=${one.batch.id} one=${one} first=${index === first} />`)}</ul>
		</section>
	`;
}

export function WorkPage() {
	const mine = useResource((signal) => getMyWork(signal), []);
	// Whether groups are hidden follows from the work that is assigned.
	useEffect(() => { loadDatasets(); }, []);
	return html`
		<${PageFrame} current="work" title="My work" where=${html`<strong>My work</strong>`}>
			${mine.error ? html`<${Trouble} title="Your work cannot be shown" error=${mine.error} retry=${mine.reload} />` : null}
			${mine.value ? html`<${Mine} items=${mine.value.items} />` : mine.error ? null : html`<${Loading} what="your work" />`}
			${dataset.value ? html`<${TeamCard} dataset=${dataset.value} changed=${mine.reload} />` : null}
		<//>
	`;
}
