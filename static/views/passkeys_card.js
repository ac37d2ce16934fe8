// @ts-check
/** One's own passkeys: made, named, taken away. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { deletePasskey, getPasskeys, makePasskey, passkeysWork } from '../api/passkeys.js';
import { ApiError } from '../api/problem.js';
import { useAttempt } from '../lib/attempt.js';
import { withForm } from '../lib/field.js';
import { loadSession } from '../state/me.js';
import { FormError } from './form_error.js';
import { proof } from './proof.js';
import { Codes, OneField } from './second_factor.js';
import { When } from './when.js';

/** @import {PasskeyJson} from '../api/passkeys.js' */

/** What one's passkeys are, and what can be done about them. @param {() => void} changed */
function usePasskeys(changed) {
	const [items, setItems] = useState(/** @type {PasskeyJson[]} */ ([]));
	const [unavailable, setUnavailable] = useState(/** @type {string | null} */ (null));
	const [codes, setCodes] = useState(/** @type {string[]} */ ([]));
	const [leaving, setLeaving] = useState(/** @type {PasskeyJson | null} */ (null));
	const { error, busy, attempt: act } = useAttempt();
	const read = () => act(getPasskeys(), (found) => { setItems(found.items); setUnavailable(found.unavailable); });
	useEffect(() => { read(); }, []);
	return {
		items, codes, leaving, error, busy, setLeaving,
		unavailable: unavailable ?? (passkeysWork() ? null : 'This browser does not support passkeys.'),
		/** @param {string} name @param {string} password */
		make: (name, password) => act(makePasskey(name, password || null), (done) => { setCodes(done.codes); read(); changed(); if (!done.codes.length) loadSession(); }),
		/** @param {PasskeyJson} one @param {string} password */
		remove: (one, password) => act(deletePasskey(one.id, password || null), () => { setLeaving(null); read(); changed(); }),
		close: () => { setCodes([]); loadSession(); },
	};
}

/** @param {{items: PasskeyJson[], leave: (one: PasskeyJson) => void}} props */
function Table({ items, leave }) {
	return html`
		<table class="table">
			<thead><tr><th>Name</th><th>Added</th><th>Last used</th><td></td></tr></thead>
			<tbody>${items.map((one) => html`
				<tr key=${one.id}>
					<th scope="row">${one.name}</th>
					<td><${When} at=${one.created} /></td>
					<td>${one.used ? html`<${When} at=${one.used} />` : 'never'}</td>
					<td><span class="table__actions"><button class="button button--small" type="button" aria-label=${`Remove ${one.name}`} onClick=${() => leave(one)}>Remove</button></span></td>
				</tr>`)}
			</tbody>
		</table>
	`;
}

/** @param {{make: (name: string, password: string) => Promise<boolean>, error: ApiError | null, busy: boolean}} props */
function NewPasskey({ make, error, busy }) {
	const send = withForm(async (said, form) => {
		if (!busy && await make(String(said.get('name')).trim(), String(said.get('password')))) form.reset();
	});
	return html`
		<form class="form passkeys__form" onSubmit=${send}>
			<div class="form__row"><label for="passkey-name">Name of the passkey</label><input class="field" id="passkey-name" name="name" required maxlength="40" autocomplete="off" placeholder="phone" /></div>
			<div class="form__row"><label for="passkey-password">${proof().label}</label><input class="field" id="passkey-password" name="password" type="password" required=${!proof().optional} maxlength="200" autocomplete="current-password" /></div>
			<${FormError} error=${error} />
			<p><button class="button" type="submit" aria-disabled=${busy}>Make a passkey</button></p>
		</form>
	`;
}

/** @param {{changed?: () => void}} props */
export function PasskeysCard({ changed = () => {} }) {
	const { items, unavailable, codes, leaving, error, busy, setLeaving, make, remove, close } = usePasskeys(changed);
	return html`
		<section class="card card--flush" aria-labelledby="account-passkeys">
			<h2 id="account-passkeys">Passkeys</h2>
			<p class="note passkeys__note">A passkey stays in a device of yours: your finger, face or PIN there replaces password and code.</p>
			${items.length ? html`<${Table} items=${items} leave=${setLeaving} />` : null}
			<div class="passkeys__form">
				${codes.length ? html`<${Codes} codes=${codes} close=${close} />` : null}
				${leaving ? html`
					<${OneField} key=${leaving.id} id="passkey-remove" ...${proof()} button=${`Remove ${leaving.name}`} name="password" type="password" complete="current-password" error=${error} send=${(/** @type {string} */ password) => remove(leaving, password)}
						beside=${html`<button class="button" type="button" onClick=${() => setLeaving(null)}>Cancel</button>`}
					>
						<p>${leaving.name} will no longer log you in. Delete it in the device, too.</p>
					<//>` : null}
			</div>
			${unavailable ? html`<p class="note passkeys__note">${unavailable.replace(/^./, (first) => first.toUpperCase())}</p>` : null}
			${!unavailable && !codes.length && !leaving ? html`<${NewPasskey} make=${make} error=${error} busy=${busy} />` : null}
		</section>
	`;
}
