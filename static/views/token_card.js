// @ts-check
/** One's own tokens: made, shown once, ended. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { endToken, getTokens, postToken } from '../api/tokens.js';
import { ApiError } from '../api/problem.js';
import { useAttempt } from '../lib/attempt.js';
import { withForm } from '../lib/field.js';
import { useResource } from '../lib/resource.js';
import { datasets } from '../state/datasets.js';
import { roleIn, whyNot } from '../state/rights.js';
import { CopyField } from './copy_field.js';
import { FormError } from './form_error.js';
import { TokenTable } from './token_table.js';

/** @import {MadeToken, Scope} from '../api/tokens.js' */
/** @import {Action} from '../api/people.js' */

const SCOPES = /** @type {{name: Scope, action: Action, note: string}[]} */ ([
	{ name: 'read', action: 'read', note: 'read only; included in all others' },
	{ name: 'annotate', action: 'annotate', note: 'lines, balls and cameras' },
	{ name: 'review', action: 'review', note: 'verdicts' },
	{ name: 'export', action: 'export', note: 'make exports' },
	{ name: 'lead', action: 'lead', note: 'import, freeze, evaluate, thresholds' },
	{ name: 'admin', action: 'administer', note: 'list people, revoke tokens, delete datasets' },
]);
const DAYS = [7, 30, 90, 365];

/** @param {{one: {name: Scope, action: Action, note: string}}} props */
function ScopeCheck({ one }) {
	// What one may in one dataset alone is enough: a token may it there.
	const able = whyNot(one.action) === '';
	const not = able ? '' : `not allowed for your role, ${roleIn()}`;
	return html`
		<label class="form__check" title=${able ? undefined : not}>
			<input type="checkbox" name="scopes" value=${one.name} disabled=${!able} defaultChecked=${one.name === 'read'} />
			<span><strong>${one.name}</strong>: ${one.note}${able ? '' : ` (${not})`}</span>
		</label>
	`;
}

/** @param {{make: (form: FormData) => Promise<boolean>, error: ApiError | null}} props */
function TokenForm({ make, error }) {
	const send = withForm(async (said, form) => { if (await make(said)) form.reset(); });
	return html`
		<form class="form tokens__form" onSubmit=${send}>
			<div class="form__columns">
				<div class="form__row"><label for="token-name">What it is for</label><input class="field" id="token-name" name="name" required maxlength="40" autocomplete="off" placeholder="nightly copy" /><small>The log shows it beside your name.</small></div>
				<div class="form__row"><label for="token-dataset">Dataset</label><select class="field" id="token-dataset" name="dataset"><option value="">all datasets</option>${(datasets.value ?? []).map(({ name }) => html`<option key=${name} value=${name}>${name}</option>`)}</select></div>
				<div class="form__row"><label for="token-days">Valid for</label><select class="field" id="token-days" name="days">${DAYS.map((days) => html`<option key=${days} value=${days} defaultSelected=${days === 90}>${days} days</option>`)}</select></div>
			</div>
			<fieldset class="tokens__scopes"><legend>Scopes</legend>${SCOPES.map((one) => html`<${ScopeCheck} key=${one.name} one=${one} />`)}</fieldset>
			<${FormError} error=${error} />
			<p><button class="button button--primary" type="submit">Make a token</button></p>
		</form>
	`;
}

/** What one's tokens are, and what can be done about them. */
function useTokens() {
	const found = useResource(() => getTokens(), []);
	const [made, setMade] = useState(/** @type {MadeToken | null} */ (null));
	const { error, attempt } = useAttempt();
	/** @param {FormData} form */
	async function make(form) {
		const scopes = /** @type {Scope[]} */ (form.getAll('scopes'));
		const asked = { name: String(form.get('name')), scopes, days: Number(form.get('days')), dataset: String(form.get('dataset')) || null };
		const done = await attempt(postToken(asked), setMade);
		found.reload();
		return done;
	}
	/** @param {number} id */
	const end = (id) => attempt(endToken(id)).then(found.reload);
	return { tokens: found.value?.items ?? [], made, error: error ?? found.error, make, end, setMade };
}

export function TokenCard() {
	const { tokens, made, error, make, end, setMade } = useTokens();
	return html`
		<section class="card card--flush" aria-labelledby="account-tokens">
			<h2 id="account-tokens">Tokens</h2>
			<p class="note tokens__note">With a token a script, or the command line, acts in your name within the scopes of the token. Anyone who has the token can do the same: keep it in a file that only you can read.</p>
			${made ? html`
				<div class="tokens__made" role="status">
					<p>This is ${made.token.name}. It is not shown again.</p>
					<${CopyField} label="Token" text=${made.text} close=${() => setMade(null)} />
				</div>` : null}
			${tokens.length ? html`<${TokenTable} tokens=${tokens} end=${end} />` : null}
			<${TokenForm} make=${make} error=${error} />
		</section>
	`;
}
