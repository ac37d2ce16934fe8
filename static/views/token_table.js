// @ts-check
/** Tokens in a table: what each is for, until when, and the button that ends it. */

import { html } from 'htm/preact';

import { ConfirmButton } from './confirm_button.js';
import { When } from './when.js';

/** @import {TokenJson} from '../api/tokens.js' */

/** @param {string} at */
const dayOf = (at) => new Date(at).toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' });

/** @param {{tokens: TokenJson[], end: (id: number) => void}} props */
export function TokenTable({ tokens, end }) {
	return html`
		<div class="table__scroll"><table class="table">
			<thead><tr><th>Name</th><th>Scopes</th><th>Dataset</th><th>Last used</th><th>Valid until</th><td></td></tr></thead>
			<tbody>${tokens.map((one) => html`
				<tr key=${one.id}>
					<th scope="row">${one.name}<small>${one.start}…</small></th>
					<td>${one.scopes.join(', ')}</td>
					<td>${one.dataset ?? 'all datasets'}</td>
					<td>${one.used ? html`<${When} at=${one.used} />` : 'never'}</td>
					<td>${one.expired ? 'expired' : dayOf(one.expires)}</td>
					<td><span class="table__actions">${one.expired
						? html`<button class="button button--small" type="button" onClick=${() => end(one.id)}>Remove<span class="hidden-text"> ${one.name}</span></button>`
						: html`<${ConfirmButton} small=${true} needs=${null} label="Revoke" question="Revoke for good?" what=${one.name} run=${() => end(one.id)} />`}</span></td>
				</tr>`)}
			</tbody>
		</table></div>
	`;
}
