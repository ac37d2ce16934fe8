// @ts-check
/** Whether the palette is open, and what was typed before it stood. */

import { signal } from '@preact/signals';

/** Milliseconds after which keys are the page's own again, though no palette came. */
const PATIENCE = 5000;

/** Which opening of the palette is shown; 0: none. */
export const paletteOpen = signal(0);
let openings = 0;

let typed = { text: '', chosen: false };
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/** Show the palette, though one that was just left may still be closing. */
export function openPalette() {
	openings += 1;
	paletteOpen.value = openings;
	typed = { text: '', chosen: false };
	// Its code may still be on its way, and what is typed meanwhile must not judge a group.
	addEventListener('keydown', keep, { capture: true });
	clearTimeout(timer);
	timer = setTimeout(giveUp, PATIENCE);
}

/** What was typed so far, and whether Enter came after it: from now on the palette hears keys itself. */
export function takeTyped() {
	clearTimeout(timer);
	removeEventListener('keydown', keep, { capture: true });
	return typed;
}

function giveUp() {
	takeTyped();
	paletteOpen.value = 0;
}

/** @param {KeyboardEvent} event */
function keep(event) {
	if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing) return;
	const { text, chosen } = typed;
	if (event.key === 'Escape') giveUp();
	else if (event.key === 'Enter') typed = { text, chosen: true };
	else if (event.key === 'Backspace') typed = { text: text.slice(0, -1), chosen };
	else if (event.key.length === 1 && !chosen) typed = { text: text + event.key, chosen };
	event.preventDefault();
	event.stopImmediatePropagation();
}
