// @ts-check
/** The help as a page of its own, with an address for each part. */

import { html } from 'htm/preact';
import { useEffect, useMemo } from 'preact/hooks';

import { activeBindings, idOf } from '../../lib/keys.js';
import { navigate, page } from '../../lib/router.js';
import { HELP_PARTS } from '../../state/palette_items.js';
import { helpOpen, helpTab } from '../../state/workspace.js';
import { PageFrame } from '../page_frame.js';
import { REVIEW_KEYS } from '../review_keys.js';
import { HelpParts } from './parts.js';

/** Keys of the review screen, though it is not on screen, and those that work everywhere. */
function allKeys() {
	const known = new Set(REVIEW_KEYS.map(idOf));
	return [...REVIEW_KEYS, ...activeBindings().filter((binding) => !known.has(idOf(binding)))];
}

export function HelpPage() {
	const shown = page.value;
	const tab = shown.page === 'help' ? shown.tab : 'keys';
	const bindings = useMemo(allKeys, []);
	// Whoever asks for help here is here already.
	useEffect(() => {
		if (!helpOpen.value) return;
		helpOpen.value = 0;
		navigate(`/help/${helpTab.value}`, { replace: true });
	}, [helpOpen.value]);
	const label = HELP_PARTS.find(({ name }) => name === tab)?.label ?? 'Keys';
	return html`
		<${PageFrame} current="help" title=${`Help: ${label}`} where=${html`<strong>Help</strong>`}>
			<section class="card help-page" aria-label="Help">
				<${HelpParts} tab=${tab} bindings=${bindings} onTab=${(/** @type {string} */ name) => navigate(`/help/${name}`, { replace: true })} />
			</section>
		<//>
	`;
}
