// @ts-check
/** Before anything else, where everybody needs a second factor and one has none. */

import { html } from 'htm/preact';
import { useEffect } from 'preact/hooks';

import { logOut, me } from '../state/me.js';
import { PasskeysCard } from './passkeys_card.js';
import { SecondFactorCard } from './second_factor.js';

export function EnrolPage() {
	useEffect(() => { document.title = 'Second factor · Touchline'; }, []);
	return html`
		<main class="login">
			<div class="factor__page">
				<h1>Hello ${me.value?.name}: this server requires a second factor</h1>
				<${SecondFactorCard} />
				<${PasskeysCard} />
				<p><button class="button" type="button" onClick=${logOut}>Log out</button></p>
			</div>
		</main>
	`;
}
