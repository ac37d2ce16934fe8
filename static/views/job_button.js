// @ts-check
/** A button that starts a job, for whoever leads the dataset; it waits while one is under way. */

import { html } from 'htm/preact';

/**
 * @param {{
 *   busy: boolean, act: () => void, title?: string, kind?: string, children: import('preact').ComponentChildren
 * }} props `kind`: further classes
 */
export function JobButton({ busy, act, title = '', kind = '', children }) {
	return html`<button data-needs="lead" class=${`button ${kind}`} type="button" aria-disabled=${busy} title=${busy ? 'Under way' : title} onClick=${() => { if (!busy) act(); }}>${children}</button>`;
}
