// @ts-check
/** Logging in: before anything is shown, or over a page whose session has ended. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { postSession } from '../api/people.js';
import { ApiError } from '../api/problem.js';
import { outbox } from '../state/outbox.js';
import { me, welcome } from '../state/me.js';
import { plural } from '../lib/format.js';

/** @import {SessionJson} from '../api/people.js' */

/** What went wrong, in a sentence and what to do about it. @param {{error: ApiError | null}} props */
export function FormError({ error }) {
	return html`<p class="form__error" role="alert">${error ? `${error.message[0].toUpperCase()}${error.message.slice(1)}. ${error.hint ?? ''}` : ''}</p>`;
}

/**
 * A form whose answer is a session.
 *
 * @param {(form: FormData) => Promise<SessionJson>} ask
 * @returns {{error: ApiError | null, busy: boolean, send: (event: SubmitEvent) => Promise<void>}}
 */
export function useSessionForm(ask) {
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	const [busy, setBusy] = useState(false);
	/** @param {SubmitEvent} event */
	async function send(event) {
		event.preventDefault();
		const form = /** @type {HTMLFormElement} */ (event.currentTarget);
		setBusy(true);
		try {
			welcome(await ask(new FormData(form)));
			setError(null);
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			setError(problem);
			/** @type {HTMLInputElement | null} */ (form.querySelector('input[type="password"]'))?.select();
		} finally {
			setBusy(false);
		}
	}
	return { error, busy, send };
}

/** @param {{name?: string}} props */
function LoginForm({ name = '' }) {
	const { error, busy, send } = useSessionForm((form) => postSession(String(form.get('name')), String(form.get('password'))));
	return html`
		<form class="form" onSubmit=${send}>
			<div class="form__row"><label for="login-name">Name</label><input class="field" id="login-name" name="name" required maxlength="200" autocomplete="username" autocapitalize="none" spellcheck=${false} defaultValue=${name} autofocus=${!name} /></div>
			<div class="form__row"><label for="login-password">Password</label><input class="field" id="login-password" name="password" type="password" required maxlength="200" autocomplete="current-password" autofocus=${Boolean(name)} /></div>
			<${FormError} error=${error} />
			<p><button class="button button--primary" type="submit" aria-disabled=${busy}>Log in</button></p>
		</form>
	`;
}

export function LoginPage() {
	const main = useRef(/** @type {HTMLElement | null} */ (null));
	useEffect(() => {
		document.title = 'Log in · Touchline';
		main.current?.querySelector('input')?.focus();
	}, []);
	return html`
		<main class="login" ref=${main}>
			<section class="card" aria-labelledby="login-title">
				<p class="login__brand">Touchline</p>
				<h1 id="login-title">Log in</h1>
				<${LoginForm} />
				<p class="note">No account, or no password? Whoever runs this server can send you a link.</p>
			</section>
		</main>
	`;
}

/** The session has ended while somebody was at work: nothing of the page goes. */
export function LoginAgain() {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	useEffect(() => {
		dialog.current?.showModal();
		/** @type {HTMLElement | null | undefined} */ (dialog.current?.querySelector('input[type="password"]'))?.focus();
	}, []);
	const waiting = outbox.value.length;
	return html`
		<dialog class="dialog" ref=${dialog} aria-labelledby="login-again" onCancel=${(/** @type {Event} */ event) => event.preventDefault()}>
			<header class="dialog__header"><h2 id="login-again">Your session has ended</h2></header>
			<p>Log in to go on where you are. ${waiting ? `${plural(waiting, 'change')} of yours ${waiting === 1 ? 'waits' : 'wait'} and will be saved then.` : 'Nothing is lost.'}</p>
			<${LoginForm} name=${me.value?.name ?? ''} />
		</dialog>
	`;
}
