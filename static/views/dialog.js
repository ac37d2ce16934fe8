// @ts-check
/** A dialog that asks: title, form, buttons. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';

import { withForm } from '../lib/field.js';

/** @import {ComponentChildren} from 'preact' */

/**
 * @param {{
 *   title: string, onClose: () => void, onSubmit: (form: FormData) => void,
 *   buttons: ComponentChildren, wide?: boolean, children?: ComponentChildren
 * }} props
 */
export function FormDialog({ title, onClose, onSubmit, buttons, wide = false, children }) {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	const gone = useRef(false);
	useEffect(() => {
		dialog.current?.showModal();
		// The first thing that is asked, not the way out.
		/** @type {HTMLElement | null | undefined} */ (dialog.current?.querySelector('input:checked, input:not([type="radio"]), select, textarea'))?.focus();
	}, []);
	// A layout effect is cleaned up while the dialog is still in the page: closing it gives the focus back to where it was.
	useLayoutEffect(() => {
		const shown = dialog.current;
		return () => {
			gone.current = true;
			shown?.close();
		};
	}, []);
	return html`
		<dialog class=${wide ? 'dialog dialog--wide' : 'dialog'} ref=${dialog} aria-labelledby="dialog-title" onClose=${() => { if (!gone.current) onClose(); }}>
			<form class="form" onSubmit=${withForm(onSubmit)}>
				<header class="dialog__header">
					<h2 id="dialog-title">${title}</h2>
					<button class="button" type="button" onClick=${() => dialog.current?.close()}>Close <kbd>Esc</kbd></button>
				</header>
				${children}
				<p class="dialog__buttons">${buttons}</p>
			</form>
		</dialog>
	`;
}
