// @ts-check
/** One's second factor: made with an authenticator, confirmed, taken away. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { beginSecondFactor, confirmSecondFactor, deleteSecondFactor, getSecondFactor } from '../api/people.js';
import { ApiError } from '../api/problem.js';
import { useAttempt } from '../lib/attempt.js';
import { withForm } from '../lib/field.js';
import { loadSession } from '../state/me.js';
import { FormError } from './form_error.js';
import { proof } from './proof.js';

/** @import {EnrolmentJson, SecondFactorJson} from '../api/people.js' */
/** @import {ComponentChildren} from 'preact' */

/** A form with one field. @param {{id: string, label: string, button: string, name: string, type?: string, complete: string, optional?: boolean, error: ApiError | null, send: (text: string) => void, beside?: ComponentChildren, children?: ComponentChildren}} props `beside`: the button */
export function OneField({ id, label, button, name, type = 'text', complete, optional = false, error, send, beside, children }) {
	return html`
		<form class="form" onSubmit=${withForm((said) => send(String(said.get(name))))}>
			${children}
			<div class="form__row"><label for=${id}>${label}</label><input class="field" id=${id} name=${name} type=${type} required=${!optional} maxlength=${type === 'password' ? 200 : 40} autocomplete=${complete} /></div>
			<${FormError} error=${error} />
			<p class="buttons"><button class="button" type="submit">${button}</button>${beside}</p>
		</form>
	`;
}

/** @param {{made: EnrolmentJson, error: ApiError | null, confirm: (code: string) => void}} props */
function Scan({ made, error, confirm }) {
	return html`
		<${OneField} key="code" id="factor-code" label="The code that it shows" button="Confirm" name="code" complete="one-time-code" error=${error} send=${confirm}>
			<p>Scan this with an authenticator on your phone, or type the secret into it.</p>
			<img class="factor__picture" src=${made.picture} alt="QR code of the secret" />
			<p class="factor__secret"><code>${made.secret.replace(/(.{4})/g, '$1 ').trim()}</code></p>
		<//>
	`;
}

/** @param {{codes: string[], close: () => void}} props */
export function Codes({ codes, close }) {
	return html`
		<div role="status">
			<p>From now on the login asks for a second factor after your password. If you lose it, each of these codes replaces it once. They are not shown again: print them, or store them with your passwords.</p>
			<ul class="factor__codes">${codes.map((code) => html`<li key=${code}><code>${code}</code></li>`)}</ul>
			<p><button class="button button--primary" type="button" onClick=${close}>I have saved them</button></p>
		</div>
	`;
}

/** What is known of one's second factor, and what can be done about it. @param {number} [again] other numbers read it again */
function useFactor(again = 0) {
	const [state, setState] = useState(/** @type {SecondFactorJson | null} */ (null));
	const [made, setMade] = useState(/** @type {EnrolmentJson | null} */ (null));
	const [codes, setCodes] = useState(/** @type {string[] | null} */ (null));
	const { error, attempt: act } = useAttempt();
	const read = () => act(getSecondFactor(), setState);
	useEffect(() => { read(); }, [again]);
	return {
		state, made, codes, error,
		begin: (/** @type {string} */ password) => act(beginSecondFactor(password || null), setMade),
		confirm: (/** @type {string} */ code) => act(confirmSecondFactor(code), (done) => { setCodes(done.codes); setMade(null); read(); }),
		remove: (/** @type {string} */ password) => act(deleteSecondFactor(password || null), read),
		close: () => { setCodes(null); loadSession(); },
	};
}

/** What there is, and how it goes. @param {{state: SecondFactorJson, error: ApiError | null, remove: (password: string) => void}} props */
function Remove({ state, error, remove }) {
	const told = html`<p>The login asks for a code after your password. ${state.codes_left} of 10 recovery codes are left.</p>`;
	if (state.required) return html`${told}<p class="note">This server requires one. If you have lost the device, an admin can remove it; then you set up another one.</p>`;
	return html`<${OneField} key="remove" id="factor-remove" ...${proof()} button="Remove it" name="password" type="password" complete="current-password" error=${error} send=${remove}>${told}<//>`;
}

/** @param {{changed?: () => void, again?: number}} props */
export function SecondFactorCard({ changed = () => {}, again = 0 }) {
	const { state, made, codes, error, begin, confirm, remove, close } = useFactor(again);
	useEffect(() => { if (codes) changed(); }, [codes]);
	return html`
		<section class="card" aria-labelledby="account-factor">
			<h2 id="account-factor">Second factor</h2>
			${codes ? html`<${Codes} codes=${codes} close=${close} />` : null}
			${made ? html`<${Scan} made=${made} error=${error} confirm=${confirm} />` : null}
			${state && !made && !codes && !state.authenticator ? html`
				<${OneField} key="begin" id="factor-begin" ...${proof()} button="Begin" name="password" type="password" complete="current-password" error=${error} send=${begin}>
					${state.on ? html`<p>The login asks for a passkey after your password; ${state.codes_left} of 10 recovery codes are left.</p>` : null}
					<p>With an authenticator (an app on your phone), a stolen password alone gives no access.</p>
				<//>` : null}
			${state && !made && !codes && state.authenticator ? html`<${Remove} state=${state} error=${error} remove=${remove} />` : null}
		</section>
	`;
}
