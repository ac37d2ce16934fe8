// @ts-check
/** Logging in: before anything is shown, or over a page whose session has ended. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';

import { enterWithPasskey, passkeysWork } from '../api/passkeys.js';
import { postSession } from '../api/people.js';
import { ApiError } from '../api/problem.js';
import { beginSignOn } from '../api/sign_on.js';
import { withForm } from '../lib/field.js';
import { outbox } from '../state/outbox.js';
import { loadSession, me, ways, welcome } from '../state/me.js';
import { plural } from '../lib/format.js';
import { FormError } from './form_error.js';
import { MaintenanceBar } from './maintenance_bar.js';
import { SignOnButton } from './sign_on_button.js';

/** @import {SessionJson} from '../api/people.js' */

/** Milliseconds. */
const ASK_AGAIN = 60_000;

/**
 * A form whose answer is a session.
 *
 * @param {(form: FormData) => Promise<SessionJson>} ask
 * @returns {{error: ApiError | null, busy: boolean, send: (event: Event) => void}}
 */
export function useSessionForm(ask) {
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	const [busy, setBusy] = useState(false);
	/** @param {FormData} said @param {HTMLFormElement} form */
	async function send(said, form) {
		setBusy(true);
		try {
			welcome(await ask(said));
			setError(null);
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			setError(problem);
			if (problem.pointer === '/code') return;
			/** @type {HTMLInputElement | null} */ (form.querySelector('input[type="password"]'))?.select();
		} finally {
			setBusy(false);
		}
	}
	return { error, busy, send: withForm(send) };
}

/** What has just appeared is typed into next. @param {HTMLInputElement | null} field */
function focused(field) {
	if (field && !field.value) field.focus();
}

/** In the place of name and password. */
function PasskeyButton() {
	const { error, busy, send } = useSessionForm(enterWithPasskey);
	if (!passkeysWork()) return null;
	return html`
		<form class="form" onSubmit=${send}>
			<p class="login__or">or</p>
			<p><button class="button" type="submit" aria-disabled=${busy}>Log in with a passkey</button></p>
			<${FormError} error=${error} />
		</form>
	`;
}

/** Every way in that there is here. @param {{name?: string}} props */
function LoginForm({ name = '' }) {
	const { password, sign_on: provider } = ways.value;
	// A longer address is not kept for whoever comes back from the provider.
	const to = () => (location.href.length < 2000 ? location.pathname + location.search : location.pathname.slice(0, 1000));
	return html`
		${provider ? html`<${SignOnButton} primary=${!password} begin=${() => beginSignOn({ to: to() })}>Log in with ${provider}<//>` : null}
		${provider && password ? html`<p class="login__or">or</p>` : null}
		${password ? html`<${PasswordForm} name=${name} /><${PasskeyButton} />` : null}
	`;
}

/** @param {{name: string}} props */
function PasswordForm({ name }) {
	const [asked, setAsked] = useState(false);
	const answered = useRef(false);
	const { error, busy, send } = useSessionForm(async (form) => {
		answered.current = asked;
		try {
			return await postSession(String(form.get('name')), String(form.get('password')), asked ? String(form.get('code')) : null);
		} catch (problem) {
			if (problem instanceof ApiError && problem.pointer === '/code') setAsked(true);
			throw problem;
		}
	});
	return html`
		<form class="form" onSubmit=${send}>
			<div class="form__row"><label for="login-name">Name</label><input class="field" id="login-name" name="name" required maxlength="200" autocomplete="username" autocapitalize="none" spellcheck=${false} defaultValue=${name} autofocus=${!name} /></div>
			<div class="form__row"><label for="login-password">Password</label><input class="field" id="login-password" name="password" type="password" required maxlength="200" autocomplete="current-password" autofocus=${Boolean(name)} /></div>
			${asked ? html`<div class="form__row"><label for="login-code">Code of your second factor</label><input class="field" id="login-code" name="code" required maxlength="40" autocomplete="one-time-code" spellcheck=${false} ref=${focused} aria-describedby="login-code-help" /><small id="login-code-help">You can also use a recovery code or a passkey. If you have none, an admin can remove the second factor.</small></div>` : null}
			<${FormError} error=${error?.pointer === '/code' && !answered.current ? null : error} />
			<p><button class="button button--primary" type="submit" aria-disabled=${busy}>Log in</button></p>
		</form>
	`;
}

/**
 * A page before somebody is let in, with the notice of maintenance. `wide`: it has cards of its own.
 *
 * @param {{title: string, heading: unknown, wide?: boolean, children?: any}} props
 */
export function EntryPage({ title, heading, wide = false, children }) {
	useEffect(() => { document.title = `${title} · Touchline`; }, [title]);
	useEffect(() => {
		// Before anybody has logged in no stream tells of another notice of maintenance.
		const timer = setInterval(loadSession, ASK_AGAIN);
		return () => clearInterval(timer);
	}, []);
	return html`
		<main class="login">
			<section class=${wide ? 'factor__page' : 'card'} aria-labelledby="entry-title">
				<${MaintenanceBar} />
				${wide ? null : html`<p class="login__brand">Touchline</p>`}
				<h1 id="entry-title">${heading}</h1>
				${children}
			</section>
		</main>
	`;
}

export function LoginPage() {
	const form = useRef(/** @type {HTMLElement | null} */ (null));
	useEffect(() => {
		/** @type {HTMLElement | null | undefined} */ (form.current?.querySelector('input') ?? form.current?.querySelector('button'))?.focus();
	}, []);
	return html`
		<${EntryPage} title="Log in" heading="Log in">
			<div ref=${form}><${LoginForm} /></div>
			<p class="note">${ways.value.password ? 'No account, or no password?' : 'No account here?'} An admin of this server can send you a link.</p>
		<//>
	`;
}

/** The session has ended while somebody was at work: nothing of the page goes. */
export function LoginAgain() {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	useLayoutEffect(() => {
		const shown = dialog.current;
		shown?.showModal();
		/** @type {HTMLElement | null | undefined} */ (shown?.querySelector('input[type="password"]') ?? shown?.querySelector('button'))?.focus();
		// While it is still in the page: closing it gives the focus back to where it was.
		return () => shown?.close();
	}, []);
	const waiting = outbox.value.length;
	return html`
		<dialog class="dialog" ref=${dialog} aria-labelledby="login-again" onCancel=${(/** @type {Event} */ event) => event.preventDefault()}>
			<header class="dialog__header"><h2 id="login-again">Your session has ended</h2></header>
			<${MaintenanceBar} />
			<p>Log in to continue here. ${waiting ? `${plural(waiting, 'unsaved change')} will then be saved.` : 'Nothing is lost.'}</p>
			<${LoginForm} name=${me.value?.name ?? ''} />
		</dialog>
	`;
}
