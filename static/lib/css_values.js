// @ts-check
/** Values of tokens.css, for what is drawn and cannot read custom properties itself. */

import { signal } from '@preact/signals';

/**
 * The values as they are now.
 *
 * @template {string} Name
 * @param {readonly Name[]} names @param {string} [before] what stands before each of them: `canvas-`
 * @returns {Record<Name, string>}
 */
export function tokens(names, before = '') {
	const style = getComputedStyle(document.documentElement);
	const pairs = names.map((name) => [name, style.getPropertyValue(`--${before}${name}`).trim()]);
	return /** @type {Record<Name, string>} */ (Object.fromEntries(pairs));
}

/**
 * What a function makes of tokens, made again when the scheme changes.
 *
 * @template T
 * @param {() => T} read
 * @returns {import('@preact/signals').Signal<T>}
 */
export function followed(read) {
	const now = signal(read());
	for (const query of ['(prefers-color-scheme: dark)', '(prefers-contrast: more)']) {
		matchMedia(query).addEventListener('change', () => { now.value = read(); });
	}
	return now;
}
