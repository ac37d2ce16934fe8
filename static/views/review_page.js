// @ts-check
/** The review screen: one group, every number beside its pixels. */

import { html } from 'htm/preact';
import { useEffect, useMemo } from 'preact/hooks';

import { useKeys } from '../lib/hooks.js';
import { picturesOf } from '../overlays/scene.js';
import { document, group, isPreview, solution } from '../state/group.js';
import { focused, maximised, stripCollapsed } from '../state/workspace.js';
import { ConflictBar, NoticeBar } from './bars.js';
import { ImageGrid } from './image_grid.js';
import { Rail } from './rail.js';
import { ReviewHeader } from './review_header.js';
import { REVIEW_KEYS } from './review_keys.js';
import { BottomStrip } from './strip.js';

/** What is focused or shown alone must exist in this group. @param {string[]} letters */
function keepWithin(letters) {
	if (!letters.includes(focused.value)) focused.value = letters[0] ?? 'A';
	if (maximised.value && !letters.includes(maximised.value)) maximised.value = null;
}

function Workspace() {
	const shown = group.value;
	const solved = solution.value;
	const live = isPreview.value;
	const saved = document.value;
	const pictures = useMemo(() => (shown ? picturesOf(shown, solved, saved) : []), [shown, solved, saved]);
	useEffect(() => keepWithin(pictures.map(({ view }) => view.letter)), [pictures]);
	if (!shown) return html`<main class="review__empty" aria-busy="true"><p>Loading…</p></main>`;
	return html`
		<main class="review__main" data-collapsed=${stripCollapsed.value} data-count=${maximised.value ? 1 : pictures.length}>
			<${ImageGrid} pictures=${pictures} />
			<${BottomStrip} group=${shown} solution=${solved} pictures=${pictures} />
		</main>
		<${Rail} group=${shown} solution=${solved} pictures=${pictures} live=${live} />
	`;
}

export function ReviewPage() {
	useKeys(REVIEW_KEYS);
	useEffect(() => {
		globalThis.document.title = group.value ? `${group.value.label} · Touchline` : 'Touchline';
	}, [group.value?.label]);
	return html`
		<div class="review">
			<${ReviewHeader} />
			<div class="bars"><${NoticeBar} /><${ConflictBar} /></div>
			<${Workspace} />
		</div>
	`;
}
