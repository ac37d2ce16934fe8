// @ts-check
/** Where the provider of single sign-on sends people back. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { cameIn } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { finishSignOn } from '../api/sign_on.js';
import { navigate, place } from '../lib/router.js';
import { me, welcome } from '../state/me.js';
import { FormError } from './form_error.js';
import { EntryPage } from './login.js';
import { OneField } from './second_factor.js';

/** @import {SignOnAnswer} from '../api/sign_on.js' */

/** What the provider says where it does not let somebody through (RFC 6749, section 4.1.2.1). */
const SAYS = /** @type {{[error: string]: {detail: string, hint: string}}} */ ({
	access_denied: { detail: 'the provider refused the login, or you cancelled it', hint: 'Log in again; the administrator of the provider decides who may use Touchline.' },
	login_required: { detail: 'you are not logged in at the provider', hint: 'Log in again.' },
	temporarily_unavailable: { detail: 'the provider is busy', hint: 'Try again in a while.' },
	server_error: { detail: 'something went wrong at the provider', hint: 'Try again in a while.' },
});
const OTHERWISE = { detail: 'the provider refused the request of this server', hint: 'The operator of this server has to check its settings.' };

/** Of what the address may say, characters: this server's own part, and the provider's. */
const LONGEST_STATE = 200;
const LONGEST = 4096;
const STRANGE = { detail: 'this address does not belong to a login at the provider', hint: 'Log in again.' };

/** What the address says, which it then forgets. @returns {SignOnAnswer | ApiError | null} */
function readAddress() {
	const { search } = place.peek();
	const [state, code, iss, error] = ['state', 'code', 'iss', 'error'].map((name) => search.get(name));
	history.replaceState(null, '', '/login');
	if (error) return new ApiError(400, SAYS[error] ?? OTHERWISE);
	if (!state || !code) return null;
	if (state.length > LONGEST_STATE || code.length > LONGEST) return new ApiError(400, STRANGE);
	return { state, code, ...(iss ? { iss } : {}) };
}

/** Ask the server, once, and again with the code of a second factor. */
function useReturn() {
	const [told] = useState(readAddress);
	const [error, setError] = useState(told instanceof ApiError ? told : null);
	const [asked, setAsked] = useState(false);
	/** @param {SignOnAnswer} answer */
	async function send(answer) {
		try {
			const { session, to } = await finishSignOn(answer);
			cameIn();
			const other = me.value?.name && me.value.name !== session.name;
			if (other) location.assign(to);
			else { navigate(to, { replace: true }); welcome(session); }
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			setAsked(problem.pointer === '/factor');
			setError(problem);
		}
	}
	useEffect(() => {
		if (told && !(told instanceof ApiError)) send(told);
		if (!told) navigate('/groups', { replace: true });
	}, []);
	/** @param {string} factor */
	const again = (factor) => { if (told && !(told instanceof ApiError)) send({ ...told, factor }); };
	return { error, asked, again };
}

export function SignOnPage() {
	const { error, asked, again } = useReturn();
	const main = useRef(/** @type {HTMLElement | null} */ (null));
	useEffect(() => { /** @type {HTMLElement | null | undefined} */ (main.current?.querySelector('input, a.button'))?.focus(); }, [asked, error]);
	return html`
		<${EntryPage} title="Log in" heading=${asked ? 'One more step' : error ? 'You are not logged in' : 'Logging in…'}>
			<div ref=${main}>
				${asked ? html`<${OneField} id="sign-on-factor" label="Code of your second factor" button="Log in" name="factor" complete="one-time-code" error=${error} send=${again} />` : null}
				${error && !asked ? html`<${FormError} error=${error} /><p><a class="button button--primary" href=${me.value ? '/account' : '/groups'}>${me.value ? 'Back to your account' : 'Back to the login'}</a></p>` : null}
				${!error ? html`<p role="status">Checking your login with the provider.</p>` : null}
			</div>
		<//>
	`;
}
