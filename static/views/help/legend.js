// @ts-check
/** The legend: every mark with a small picture of it. */

import { html } from 'htm/preact';
import { useCallback } from 'preact/hooks';

import { Canvas } from '../../lib/canvas.js';
import { colours } from '../../lib/colours.js';
import { HEIGHT, WIDTH } from './legend_scene.js';
import { LEGEND } from './legend_rows.js';

/** @import {Row} from './legend_rows.js' */

/** @param {{row: Row}} props */
function Sample({ row }) {
	const theme = colours.value;
	// Drawn again when the scheme changes.
	const draw = useCallback((/** @type {CanvasRenderingContext2D} */ context) => row.draw?.(context), [row, theme]);
	return row.draw ? html`<${Canvas} class="legend__canvas" width=${WIDTH} height=${HEIGHT} name="" draw=${draw} />` : row.part;
}

export function Legend() {
	return html`
		<p class="note">The same code draws these examples and the real pictures. Dash and shape have a meaning as well, so colour is never the only sign.</p>
		<div class="legend">
			${LEGEND.map(({ title, rows }) => html`
				<section key=${title}>
					<h3>${title}</h3>
					<dl>
						${rows.map((row) => html`
							<div key=${row.name} class="legend__row" data-tokens=${row.tokens}>
								<dt><span class="legend__picture"><${Sample} row=${row} /></span><span class="legend__name">${row.name}</span></dt>
								<dd>${row.meaning}</dd>
							</div>`)}
					</dl>
				</section>`)}
		</div>
	`;
}
