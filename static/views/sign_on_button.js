// @ts-check
/** The button that leads to the provider of single sign-on. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { ApiError } from '../api/problem.js';
import { FormError } from './form_error.js';

/** @param {{begin: () => Promise<{address: string}>, primary?: boolean, children?: unknown}} props */
export function SignOnButton({ begin, primary = false, children }) {
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	const [busy, setBusy] = useState(false);
	async function go() {
		if (busy) return;
		setBusy(true);
		try {
			location.assign((await begin()).address);
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			setError(problem);
			setBusy(false);
		}
	}
	return html`
		<div class="form">
			<p><button class="button ${primary ? 'button--primary' : ''}" type="button" aria-disabled=${busy} onClick=${go}>${children}</button></p>
			<${FormError} error=${error} />
		</div>
	`;
}
