// @ts-check
/** Where a link leads that is good once: choosing a password. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { lookAtLink, postLink } from '../api/people.js';
import { ApiError } from '../api/problem.js';
import { beginSignOn } from '../api/sign_on.js';
import { withValue } from '../lib/field.js';
import { navigate } from '../lib/router.js';
import { ways } from '../state/me.js';
import { FormError } from './form_error.js';
import { EntryPage, useSessionForm } from './login.js';
import { SignOnButton } from './sign_on_button.js';

/** @typedef {{name: string | null, joined: boolean}} Meant */

/** @param {Meant} meant */
function titleOf({ name, joined }) {
	if (name === null) return 'Become the first admin';
	return joined ? `A new password for ${name}` : `Welcome, ${name}`;
}

/** @param {{meant: Meant, token: string}} props */
function Ways({ meant, token }) {
	const [name, setName] = useState('');
	const { password, sign_on: provider } = ways.value;
	const said = meant.name === null ? { name } : {};
	return html`
		${meant.name === null ? html`<div class="form"><div class="form__row"><label for="join-name">Name</label><input class="field" id="join-name" name="name" required maxlength="40" autocomplete="username" autocapitalize="none" spellcheck=${false} value=${name} onInput=${withValue(setName)} /><small>Small letters and digits; history and verdicts show this name.</small></div></div>` : null}
		${provider ? html`<${SignOnButton} primary=${!password} begin=${() => beginSignOn({ link: token, ...said })}>Continue with ${provider}<//>` : null}
		${provider && password ? html`<p class="login__or">or choose a password of this server</p>` : null}
		${password ? html`<${JoinForm} meant=${meant} token=${token} said=${said} />` : null}
	`;
}

/** @param {{meant: Meant, token: string, said: {name?: string}}} props */
function JoinForm({ meant, token, said }) {
	const { error, busy, send } = useSessionForm(async (form) => {
		const session = await postLink({ token, password: String(form.get('password')), ...said }).catch((problem) => {
			// The password is set; the login asks for the rest.
			if (problem instanceof ApiError && problem.pointer === '/code') location.assign('/groups');
			throw problem;
		});
		navigate('/groups', { replace: true });
		return session;
	});
	return html`
		<form class="form" onSubmit=${send}>
			<input class="hidden-text" name="username" autocomplete="username" value=${meant.name ?? said.name} readonly tabindex="-1" aria-hidden="true" />
			<div class="form__row"><label for="join-password">Password</label><input class="field" id="join-password" name="password" type="password" required minlength="10" maxlength="200" autocomplete="new-password" /><small>At least 10 characters. Three or four plain words make a good password.</small></div>
			<${FormError} error=${error} />
			<p><button class="button button--primary" type="submit" aria-disabled=${busy}>Set the password and log in</button></p>
		</form>
	`;
}

export function JoinPage() {
	// The token leaves the address bar, and the history with it.
	const [token] = useState(() => location.hash.slice(1));
	const [meant, setMeant] = useState(/** @type {Meant | null} */ (null));
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	useEffect(() => {
		history.replaceState(null, '', '/join');
		// What no link ends with is answered like one that is not good any more.
		lookAtLink(/^[\w-]{1,200}$/.test(token) ? token : '-').then(setMeant, (problem) => {
			if (!(problem instanceof ApiError)) throw problem;
			setError(problem);
		});
	}, []);
	return html`
		<${EntryPage} title="Choose a password" heading=${meant ? titleOf(meant) : 'Your link'}>
			${meant ? html`<${Ways} meant=${meant} token=${token} />` : null}
			${error ? html`<${FormError} error=${error} /><p><a class="button" href="/groups">Log in</a></p>` : null}
		<//>
	`;
}
