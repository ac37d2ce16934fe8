// @ts-check
/** One's own account: where one is logged in, the password, the second factor, passkeys, and tokens for scripts. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { endSession, getSessions, putPassword } from '../api/people.js';
import { ApiError } from '../api/problem.js';
import { getOwnWays } from '../api/sign_on.js';
import { browserName } from '../lib/browser_name.js';
import { isTeam, logOut, me } from '../state/me.js';
import { FormError } from './form_error.js';
import { useSessionForm } from './login.js';
import { Loading, NoAccounts, PageFrame, Trouble } from './page_frame.js';
import { PasskeysCard } from './passkeys_card.js';
import { SecondFactorCard } from './second_factor.js';
import { TokenCard } from './token_card.js';
import { IdentityCard } from './identity_card.js';
import { When } from './when.js';

/** @import {OpenSessionJson} from '../api/people.js' */
/** @import {OwnWaysJson} from '../api/sign_on.js' */

/** @param {{one: OpenSessionJson, end: (id: number | null) => void}} props */
function SessionRow({ one, end }) {
	return html`
		<tr>
			<th scope="row">${browserName(one.browser)}${one.this ? html` <strong>(this one)</strong>` : null}<small>${one.address}</small></th>
			<td><${When} at=${one.created} /></td>
			<td><${When} at=${one.seen} /></td>
			<td><span class="table__actions">${one.this ? null : html`<button class="button button--small" type="button" aria-label=${`Log out ${browserName(one.browser)}`} onClick=${() => end(one.id)}>Log out</button>`}</span></td>
		</tr>
	`;
}

/** @param {{changed: () => void}} props */
function PasswordForm({ changed }) {
	const [done, setDone] = useState(false);
	const { error, busy, send } = useSessionForm(async (form) => {
		setDone(false);
		const session = await putPassword(String(form.get('old')), String(form.get('new')));
		setDone(true);
		changed();
		return session;
	});
	return html`
		<section class="card" aria-labelledby="account-password">
			<h2 id="account-password">Password</h2>
			<form class="form" onSubmit=${send}>
				<input class="hidden-text" name="username" autocomplete="username" value=${me.value?.name ?? ''} readonly tabindex="-1" aria-hidden="true" />
				<div class="form__row"><label for="password-old">Current password</label><input class="field" id="password-old" name="old" type="password" required maxlength="200" autocomplete="current-password" /></div>
				<div class="form__row"><label for="password-new">New password</label><input class="field" id="password-new" name="new" type="password" required minlength="10" maxlength="200" autocomplete="new-password" /><small>At least 10 characters. All your other sessions end.</small></div>
				<${FormError} error=${error} />
				<p class="buttons"><button class="button" type="submit" aria-disabled=${busy}>Change password</button><span role="status">${done ? 'Password changed.' : ''}</span></p>
			</form>
		</section>
	`;
}

export function AccountPage() {
	return isTeam ? html`<${Account} />` : html`<${NoAccounts} current="account" title="Account" />`;
}

function Account() {
	const [sessions, setSessions] = useState(/** @type {OpenSessionJson[] | null} */ (null));
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	const [factors, setFactors] = useState(0);
	const [ways, setWays] = useState(/** @type {OwnWaysJson | null} */ (null));
	const read = () => Promise.all([getSessions(), getOwnWays()]).then(([{ items }, own]) => { setSessions(items); setWays(own); setError(null); }, setError);
	useEffect(() => { read(); }, []);
	/** @param {number | null} id */
	const end = (id) => { endSession(id).then(read, setError); };
	return html`
		<${PageFrame} current="account" title="Account" where=${html`<strong>Account</strong>`}
			actions=${me.value ? html`<button class="button" type="button" onClick=${logOut}>Log out</button>` : null}
		>
			${error ? html`<${Trouble} title="The account cannot be shown" error=${error} retry=${read} />` : null}
			${!sessions && !error ? html`<${Loading} what="sessions" />` : null}
			${sessions && ways ? html`
				<div class="account">
					<section class="card card--flush" aria-labelledby="account-sessions">
						<h2 id="account-sessions">Sessions of ${me.value?.name} (${me.value?.role})</h2>
						<table class="table">
							<thead><tr><th>Browser</th><th>Logged in</th><th>Last used</th><td></td></tr></thead>
							<tbody>${sessions.map((one) => html`<${SessionRow} key=${one.id} one=${one} end=${end} />`)}</tbody>
						</table>
						${sessions.length > 1 ? html`<p class="buttons"><button class="button" type="button" onClick=${() => end(null)}>Log out all other sessions</button></p>` : null}
					</section>
					<${SecondFactorCard} changed=${read} again=${factors} />
					<div class="account__ways">
						<${IdentityCard} ways=${ways} changed=${read} />
						${ways.password && !ways.only ? html`<${PasswordForm} changed=${read} />` : null}
						<${PasskeysCard} changed=${() => { read(); setFactors(factors + 1); }} />
					</div>
				</div>
				<${TokenCard} />` : null}
		<//>
	`;
}
