// @ts-check
/** What went wrong with a form. */

import { html } from 'htm/preact';

import { sentenceOf } from '../api/problem.js';

/** @import {ApiError} from '../api/problem.js' */

/** What went wrong, in a sentence and what to do about it. @param {{error: ApiError | null, card?: boolean}} props `card`: it stands among cards */
export function FormError({ error, card = false }) {
	return html`<p class=${card ? 'card form__error' : 'form__error'} role="alert">${error ? sentenceOf(error) : ''}</p>`;
}
