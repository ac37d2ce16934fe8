// @ts-check
/** The help over a page: nobody loses their place. */

import { html } from 'htm/preact';
import { useLayoutEffect, useRef } from 'preact/hooks';

import { helpOpen, helpTab } from '../../state/workspace.js';
import { HelpParts } from './parts.js';

/** @param {{opening: number}} props */
export function Help({ opening }) {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	useLayoutEffect(() => dialog.current?.showModal(), []);
	const close = () => dialog.current?.close();
	return html`
		<dialog class="dialog dialog--wide help-dialog" ref=${dialog} aria-labelledby="help-title" onClose=${() => { if (helpOpen.value === opening) helpOpen.value = 0; }}>
			<header class="dialog__header">
				<h2 id="help-title">Help</h2>
				<a class="link help-dialog__own" href=${`/help/${helpTab.value}`} onClick=${close}>Open as a page</a>
				<form method="dialog"><button class="button" type="submit" autofocus>Close <kbd>Esc</kbd></button></form>
			</header>
			<${HelpParts} tab=${helpTab.value} onTab=${(/** @type {string} */ name) => { helpTab.value = name; }} onLeave=${close} />
		</dialog>
	`;
}
