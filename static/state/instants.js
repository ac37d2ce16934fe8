// @ts-check
/** The frames just before and after that of a view, to see whether it shows the same instant. */

import { effect, signal } from '@preact/signals';

import { getFramesAround } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { endDrawing } from './drawing.js';
import { draft, group, pending } from './group.js';
import { loadImage } from './images.js';
import { announce, complain, explain } from './notice.js';
import { drawing, focused, otherInstant, selected } from './workspace.js';

/** @import {NeighbourFrame} from '../api/client.js' */
/** @import {ViewJson} from '../api/types.js' */

const NONE = 'This dataset has no frames before or after this one.';
const KEPT = 64;

/** The frames around those of views, by id of the view. */
export const framesAround = signal(/** @type {ReadonlyMap<number, NeighbourFrame[]>} */ (new Map()));

/** Ask which frames lie around that of a view, once. @param {ViewJson} view @returns {Promise<NeighbourFrame[]>} */
export async function findFramesAround(view) {
	if (!view.neighbours) return [];
	const known = framesAround.value.get(view.id);
	if (known) return known;
	const { items } = await getFramesAround(view.neighbours);
	framesAround.value = new Map([...[...framesAround.value].slice(1 - KEPT), [view.id, items]]);
	return items;
}

/** Show the frame before (-1) or after (1) what the focused view shows. @param {-1 | 1} by */
export async function stepInstant(by) {
	const view = group.value?.views.find(({ letter }) => letter === focused.value);
	if (!view) return;
	try {
		const items = await findFramesAround(view);
		if (items.length === 0) explain(NONE);
		else await show(view, items, by);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`The frame cannot be shown: ${error.message}`);
	}
}

/** @param {ViewJson} view @param {NeighbourFrame[]} items @param {-1 | 1} by */
async function show(view, items, by) {
	const present = otherInstant.value?.view === view.id ? otherInstant.value.offset : 0;
	const ahead = items.map(({ offset }) => offset).concat(0).filter((offset) => (offset - present) * by > 0);
	const offset = ahead.sort((a, b) => (a - b) * by)[0];
	if (offset === undefined) {
		explain(`No more frames ${by < 0 ? 'before' : 'after'} this one can be shown. At most five are shown, if they are on disk.`);
		return;
	}
	const next = items.find((item) => item.offset === offset);
	// Before it is shown, so that no empty picture stands between two frames.
	if (next) await loadImage(next.image);
	if (focused.value !== view.letter || !group.value?.views.some(({ id }) => id === view.id)) return;
	if (drawing.value) endDrawing();
	selected.value = null;
	otherInstant.value = next ? { view: view.id, offset, label: next.label, image: next.image } : null;
	announce(next ? `View ${view.letter} shows ${next.label}. You can look at it, but not edit it.` : `View ${view.letter} shows its own frame again.`);
}

/** Show the view's own frame again. */
export function backToInstant() {
	otherInstant.value = null;
	announce('The view shows the instant of the group again.');
}

// Whoever changes something must see what they change.
effect(() => {
	if (pending.value.length > 0 || draft.value || drawing.value || selected.value) otherInstant.value = null;
});
