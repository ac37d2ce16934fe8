// @ts-check
/** One's own account at the provider of single sign-on: linked, unlinked. */

import { html } from 'htm/preact';

import { beginLink, deleteIdentity } from '../api/sign_on.js';
import { useAttempt } from '../lib/attempt.js';
import { proof } from './proof.js';
import { OneField } from './second_factor.js';
import { When } from './when.js';

/** @import {OwnWaysJson} from '../api/sign_on.js' */

/** @param {{ways: OwnWaysJson, changed: () => void}} props */
export function IdentityCard({ ways, changed }) {
	const { error, attempt } = useAttempt();
	/** @param {Promise<unknown>} doing */
	const act = (doing) => attempt(doing, changed);
	const { identity, provider, password } = ways;
	if (!provider && !identity) return null;
	return html`
		<section class="card" aria-labelledby="account-identity">
			<h2 id="account-identity">${provider ?? 'Single sign-on'}</h2>
			${identity ? html`
				<p class="identity__come">You log in as <strong class="identity__shown">${identity.shown}</strong>, linked <${When} at=${identity.created} />${identity.used ? html`, used <${When} at=${identity.used} />` : null}.</p>
				${provider ? null : html`<p class="note">Single sign-on is no longer set up on this server.</p>`}
				${password ? html`<${OneField} key="unlink" id="identity-unlink" ...${proof()} button="Unlink it" name="password" type="password" complete="current-password" error=${error} send=${(/** @type {string} */ said) => act(deleteIdentity(said || null))} />`
					: html`<p class="note">It is your only way to log in. An admin can send you a link to choose a password.</p>`}` : null}
			${!identity && provider ? html`
				<${OneField} key="link" id="identity-link" ...${proof()} button=${`Link your account of ${provider}`} name="password" type="password" complete="current-password" error=${error} send=${(/** @type {string} */ said) => act(beginLink(said || null).then(({ address }) => location.assign(address)))}>
					<p>Once it is linked you log in with ${provider}, without a password of this server.</p>
				<//>` : null}
		</section>
	`;
}
