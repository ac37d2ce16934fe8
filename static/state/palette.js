// @ts-check
/** Whether the palette is open. */

import { signal } from '@preact/signals';

/** Which opening of the palette is shown; 0: none. */
export const paletteOpen = signal(0);
let openings = 0;

/** Show the palette, though one that was just left may still be closing. */
export function openPalette() {
	openings += 1;
	paletteOpen.value = openings;
}
