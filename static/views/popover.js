// @ts-check
/** A button with a small panel below it, closed by Escape or a click elsewhere. */

import { html } from 'htm/preact';
import { useRef, useState } from 'preact/hooks';

/** @import {ComponentChildren} from 'preact' */

/**
 * @param {{
 *   id: string, label: ComponentChildren, title?: string,
 *   children: (close: () => void) => ComponentChildren
 * }} props `children` is drawn while the panel is open
 */
export function Popover({ id, label, title, children }) {
	const panel = useRef(/** @type {HTMLDivElement | null} */ (null));
	const [open, setOpen] = useState(false);
	const close = () => panel.current?.hidePopover();
	return html`
		<button class="button" type="button" popovertarget=${id} aria-expanded=${open} title=${title}>${label}</button>
		<div
			class="popover" id=${id} popover ref=${panel}
			onToggle=${(/** @type {ToggleEvent} */ event) => setOpen(event.newState === 'open')}
		>${open ? children(close) : null}</div>
	`;
}
