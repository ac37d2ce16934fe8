// @ts-check
/** Webhooks of a dataset: who is told what happens in it, and whether messages arrive. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { deleteWebhook, getDeliveries, getWebhooks, patchWebhook, pingWebhook, postWebhook, renewWebhookSecret, sendAgain } from '../api/webhooks.js';
import { useAttempt } from '../lib/attempt.js';
import { withForm } from '../lib/field.js';
import { useResource } from '../lib/resource.js';
import { whyNot } from '../state/rights.js';
import { CopyField } from './copy_field.js';
import { ConfirmButton } from './confirm_button.js';
import { FormError } from './form_error.js';
import { Trouble } from './page_frame.js';
import { Term } from './term.js';
import { When } from './when.js';

/** @import {DeliveryJson, WebhookJson, WebhookList} from '../api/webhooks.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** Messages that are shown of a webhook. */
const SHOWN = 10;
/** How soon to look again while something waits, in ms, and for how long after somebody did something. */
const SOON_MS = 2000, WATCH_MS = 30_000;
/** What each kind of message tells. */
const TELLS = /** @type {Record<string, string>} */ ({
	'group.changed': 'lines, balls or cameras changed',
	'group.commented': 'a comment was written (text not included)',
	'group.judged': 'accepted, rejected, deferred',
	'dataset.changed': 'imports, thresholds, static cameras, pitches',
	'batch.given_out': 'a batch was assigned',
	'batch.handed_on': 'a batch was reassigned',
	'batch.done': 'the last group of a batch is done',
	'batch.stalled': 'a batch has no activity, or its due date has passed',
	'group.disputed': 'annotations differ and need a decision',
	'group.handed_back': 'work was returned (reason not included)',
	'version.frozen': 'a version was frozen',
	'job.done': 'an import, export or other job ended',
	'job.failed': 'a job failed',
});

/** A secret that is shown once. @param {{url: string, secret: string, close: () => void}} props */
function Secret({ url, secret, close }) {
	return html`
		<div class="webhooks__secret" role="status">
			<p>What is sent to <strong>${url}</strong> is signed with this secret. It is not shown again.</p>
			<${CopyField} label="Secret" text=${secret} close=${close} />
		</div>
	`;
}

/** @param {{found: WebhookList, make: (url: string, kinds: string[]) => Promise<boolean>}} props */
function NewWebhook({ found, make }) {
	const send = withForm(async (said, form) => {
		if (await make(String(said.get('url')), said.getAll('kinds').map(String))) form.reset();
	});
	return html`
		<form class="form webhooks__new" onSubmit=${send}>
			<div class="form__row">
				<label for="webhook-url">Address</label>
				<input class="field" id="webhook-url" name="url" type="url" required placeholder=${found.allowed[0]} autocomplete="off" spellcheck=${false} />
				<small>The operator of this server allows addresses that begin with ${found.allowed.join(' or ')}</small>
			</div>
			<fieldset class="form__row webhooks__kinds">
				<legend class="form__label">Events</legend>
				${found.kinds.map((kind) => html`<label key=${kind} class="form__check"><input type="checkbox" name="kinds" value=${kind} /><span>${kind}<small>${TELLS[kind]}</small></span></label>`)}
			</fieldset>
			<p><button class="button" type="submit">Add the webhook</button></p>
		</form>
	`;
}

/** @param {{one: DeliveryJson, again: () => void}} props */
function DeliveryRow({ one, again }) {
	const [open, setOpen] = useState(false);
	const told = one.state === 'delivered' ? 'delivered' : one.state === 'failed' ? 'failed' : one.attempts ? 'will be retried' : 'waiting';
	return html`
		<tr>
			<th scope="row">${one.kind}<small><${When} at=${one.created} /></small></th>
			<td>${told}${one.attempts > 1 ? ` after ${one.attempts} tries` : ''}${one.problem ? html`<small class="form__error">${one.problem}</small>` : null}
				${open ? html`<pre class="webhooks__body">${one.body}</pre>` : null}</td>
			<td><span class="table__actions">
				<button class="button button--small" type="button" aria-expanded=${open} onClick=${() => setOpen(!open)}>${open ? 'Hide' : 'Show'}<span class="hidden-text"> message ${one.message}</span></button>
				<button class="button button--small" type="button" onClick=${again}>Send again<span class="hidden-text"> ${one.message}</span></button>
			</span></td>
		</tr>
	`;
}

/** @param {{dataset: number, one: WebhookJson, act: (doing: Promise<unknown>) => Promise<boolean>}} props */
function Deliveries({ dataset, one, act }) {
	const found = useResource(async () => getDeliveries(dataset, one.id, SHOWN), [dataset, one]);
	if (found.error) return html`<p class="form__error">${sentenceOf(found.error)}</p>`;
	if (!found.value) return null;
	if (!found.value.items.length) return html`<p class="webhooks__none">Nothing was sent yet.</p>`;
	return html`
		<div class="table__scroll"><table class="table">
			<caption class="hidden-text">The last messages to ${one.url}</caption>
			<tbody>${found.value.items.map((item) => html`<${DeliveryRow} key=${item.id} one=${item} again=${() => act(sendAgain(dataset, one.id, item.id)).then(found.reload)} />`)}</tbody>
		</table></div>
	`;
}

/** @param {{dataset: number, one: WebhookJson, act: (doing: Promise<any>, then?: (done: any) => void) => Promise<boolean>, show: (url: string, secret: string) => void}} props */
function WebhookItem({ dataset, one, act, show }) {
	const [open, setOpen] = useState(false);
	const counts = [one.waiting ? `${one.waiting} waiting` : '', `${one.delivered} delivered`, one.failed ? `${one.failed} failed` : ''].filter(Boolean).join(', ');
	const renew = () => act(renewWebhookSecret(dataset, one.id), (done) => show(one.url, done.secret));
	return html`
		<li class="webhooks__item">
			<div class="webhooks__head">
				<div><strong class="webhooks__url">${one.url}</strong><small>${one.kinds.join(', ')} · ${counts}</small>${one.off ? html`<small class="form__error">Off: ${one.off}.</small>` : null}</div>
				<span class="table__actions">
					<button class="button button--small" type="button" aria-expanded=${open} onClick=${() => setOpen(!open)}>Messages<span class="hidden-text"> to ${one.url}</span></button>
					${one.off ? null : html`<button class="button button--small" type="button" onClick=${() => { setOpen(true); act(pingWebhook(dataset, one.id)); }}>Send a test<span class="hidden-text"> to ${one.url}</span></button>`}
					<button class="button button--small" type="button" onClick=${() => act(patchWebhook(dataset, one.id, { on: one.off !== null }))}>${one.off ? 'Turn on' : 'Turn off'}<span class="hidden-text"> ${one.url}</span></button>
					<${ConfirmButton} small=${true} label="New secret" question="Replace the secret? The old one ends." what=${`for ${one.url}`} run=${renew} />
					<${ConfirmButton} small=${true} label="Delete" question="Delete it with its messages?" what=${one.url} run=${() => act(deleteWebhook(dataset, one.id))} />
				</span>
			</div>
			${open ? html`<${Deliveries} dataset=${dataset} one=${one} act=${act} />` : null}
		</li>
	`;
}

/** @param {{dataset: DatasetJson}} props */
export function WebhooksCard({ dataset }) {
	const may = whyNot('lead', dataset.name) === '';
	const found = useResource(async (signal) => (may ? getWebhooks(dataset.id, signal) : null), [dataset.id, may]);
	const [secret, setSecret] = useState(/** @type {{url: string, secret: string} | null} */ (null));
	const { error, attempt } = useAttempt();
	const [watched, setWatched] = useState(0);
	const waits = found.value?.items.some(({ waiting, off }) => waiting && !off);
	useEffect(() => {
		if (!waits || Date.now() > watched) return undefined;
		const timer = setTimeout(found.reload, SOON_MS);
		return () => clearTimeout(timer);
	}, [found.value]);
	/** @param {Promise<any>} doing @param {(done: any) => void} [then] */
	async function act(doing, then = () => {}) {
		const done = await attempt(doing, (answer) => { then(answer); setWatched(Date.now() + WATCH_MS); });
		found.reload();
		return done;
	}
	if (found.error) return html`<${Trouble} title="The webhooks cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (!may || !found.value || !(found.value.allowed.length || found.value.items.length)) return null;
	const show = (/** @type {string} */ url, /** @type {string} */ text) => setSecret({ url, secret: text });
	return html`
		<section class="card webhooks" aria-labelledby="webhooks-title">
			<h2 id="webhooks-title"><${Term} word="webhook">Webhooks<//></h2>
			${secret ? html`<${Secret} ...${secret} close=${() => setSecret(null)} />` : null}
			${error ? html`<${FormError} error=${error} />` : null}
			<ul class="webhooks__list">${found.value.items.map((one) => html`<${WebhookItem} key=${one.id} dataset=${dataset.id} one=${one} act=${act} show=${show} />`)}</ul>
			${found.value.allowed.length ? html`<${NewWebhook} found=${found.value} make=${(/** @type {string} */ url, /** @type {string[]} */ kinds) => act(postWebhook(dataset.id, url, kinds), (done) => show(url, done.secret))} />` : null}
		</section>
	`;
}
