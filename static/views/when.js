// @ts-check
/** A moment: how long ago, and exactly when on hovering. */

import { html } from 'htm/preact';

import { ago } from '../lib/format.js';
import { useNow } from '../lib/hooks.js';

const DAY = 86_400_000;

/** @param {{at: string | null}} props ISO 8601 */
export function When({ at }) {
	const now = useNow(20_000);
	if (!at) return html`–`;
	const then = Date.parse(at);
	const text = now - then < DAY ? ago(then, now)
		: new Date(then).toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' });
	return html`<time datetime=${at} title=${new Date(then).toLocaleString('en-GB')}>${text}</time>`;
}
