// @ts-check
/** What the paint of the picture says of the lines, over the picture. */

import { html } from 'htm/preact';

import { fixed, sharePercent } from '../../lib/format.js';
import { asking, isPaintCurrent, paint, paintShown } from '../../state/paint.js';

/** @import {PaintJson} from '../../api/paint.js' */

/** @param {PaintJson} paint */
function numbersOf({ supported, explained, error_px: error, moved_px: moved }) {
	return [
		['Markings with paint', supported === null ? null : sharePercent(supported)],
		['Paint with a marking', explained === null ? null : sharePercent(explained)],
		['Distance from paint to marking', error === null ? null : fixed(error, 2, ' px')],
		['Camera off the paint', moved === null ? null : fixed(moved, 1, ' px')],
	].filter(([, value]) => value !== null);
}

export function PaintChip() {
	if (!paintShown.value) return null;
	const found = paint.value;
	if (!found) return asking.value ? html`<p class="paint-chip" role="status">Reading the paint…</p>` : null;
	return html`
		<div class="paint-chip" role="status" aria-busy=${!isPaintCurrent.value} data-outcome=${found.outcome}>
			${found.sentence ? html`<p>${found.sentence}</p>` : null}
			<dl>${numbersOf(found).map(([name, value]) => html`<div key=${name}><dt>${name}</dt><dd>${value}</dd></div>`)}</dl>
		</div>
	`;
}
