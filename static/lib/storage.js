// @ts-check
/** What one person likes on one machine; nothing breaks without it. */

import { effect, signal } from '@preact/signals';

/**
 * A signal that survives a reload.
 *
 * @template T
 * @param {string} name
 * @param {T} initial
 * @returns {import('@preact/signals').Signal<T>}
 */
export function stored(name, initial) {
	const key = `touchline.${name}`;
	const value = signal(readStored(key, initial));
	effect(() => {
		try {
			localStorage.setItem(key, JSON.stringify(value.value));
		} catch {
			// Private windows may refuse; the setting then lasts as long as the page.
		}
	});
	return value;
}

/** @template T @param {string} key @param {T} initial @returns {T} */
function readStored(key, initial) {
	try {
		const text = localStorage.getItem(key);
		const value = text === null ? initial : JSON.parse(text);
		return typeof value === typeof initial ? value : initial;
	} catch {
		return initial;
	}
}
