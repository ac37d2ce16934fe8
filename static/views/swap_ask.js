// @ts-check
/** Before left and right are swapped in a view that no finding names: what that would do, and what was probably meant. */

import { html } from 'htm/preact';
import { useMemo } from 'preact/hooks';

import { useKeys } from '../lib/hooks.js';
import { swapSides } from '../state/edits.js';
import { solution, submit } from '../state/group.js';
import { swappedViews, swapWarning } from '../state/sides.js';
import { cancelAsking } from '../state/verdicts.js';
import { asking, focused, focusView } from '../state/workspace.js';

/** @import {GroupDocument, ViewJson} from '../api/types.js' */

/** @param {ViewJson | undefined} view */
function swap(view) {
	asking.value = null;
	if (!view) return;
	focusView(view.letter);
	submit(swapSides(view));
}

/** @param {{group: GroupDocument}} props */
export function SwapAsk({ group }) {
	const view = group.views.find(({ letter }) => letter === focused.value);
	const named = group.views.find(({ key }) => swappedViews(solution.value).includes(key));
	const warning = view ? swapWarning(group, solution.value, view) : null;
	useKeys(useMemo(() => [
		{ keys: ['Enter'], label: 'Swap left and right in the view that the finding names', group: 'Edit', run: () => (named ? swap(named) : cancelAsking()) },
		{ keys: ['m'], label: 'Swap left and right in the focused view anyway', group: 'Edit', run: () => swap(view) },
	], [view, named]));
	if (!view) return null;
	const title = named && named !== view ? `The finding is about view ${named.letter}, not ${view.letter}.` : `Swap left and right of all lines in view ${view.letter}?`;
	return html`
		<section class="ask" aria-label=${title}>
			<p class="ask__title">${title} <kbd>Esc</kbd></p>
			${warning ? html`<p class="ask__warning">${warning}</p>` : null}
			<p class="ask__buttons">
				${named && named !== view
					? html`<button class="button button--primary" type="button" onClick=${() => swap(named)}>Swap ${named.letter} <kbd>Enter</kbd></button>`
					: html`<button class="button button--primary" type="button" onClick=${cancelAsking}>Do not swap <kbd>Enter</kbd></button>`}
				<button class="button" type="button" onClick=${() => swap(view)}>Swap ${view.letter} anyway <kbd>M</kbd></button>
			</p>
		</section>
	`;
}
