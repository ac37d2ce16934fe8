// @ts-check
/** Before anything else, where everybody needs a second factor and one has none. */

import { html } from 'htm/preact';

import { logOut, me } from '../state/me.js';
import { EntryPage } from './login.js';
import { PasskeysCard } from './passkeys_card.js';
import { SecondFactorCard } from './second_factor.js';

export function EnrolPage() {
	return html`
		<${EntryPage} title="Second factor" wide=${true} heading=${`Hello ${me.value?.name}: this server requires a second factor`}>
			<${SecondFactorCard} />
			<${PasskeysCard} />
			<p><button class="button" type="button" onClick=${logOut}>Log out</button></p>
		<//>
	`;
}
