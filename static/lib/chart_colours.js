// @ts-check
/** The colours of tokens.css for charts; they follow the scheme. */

import { signal } from '@preact/signals';

const NAMES = /** @type {const} */ (['ink', 'muted', 'line', 'bad', 'panel', 'chart-a', 'chart-b', 'chart-c', 'chart-d', 'chart-e', 'chart-f', 'chart-grid']);

/** @typedef {typeof NAMES[number]} ChartColour */

/** @returns {Record<ChartColour, string>} */
function read() {
	const style = getComputedStyle(document.documentElement);
	const pairs = NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]);
	return Object.fromEntries(pairs);
}

/** As they are now. */
export const chartColours = signal(read());

for (const query of ['(prefers-color-scheme: dark)', '(prefers-contrast: more)']) {
	matchMedia(query).addEventListener('change', () => { chartColours.value = read(); });
}
