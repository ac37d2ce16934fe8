// @ts-check
/** What one person likes on one machine; nothing breaks without it. */

import { effect, signal } from '@preact/signals';

/**
 * A signal that survives a reload.
 *
 * @template T
 * @param {string} name
 * @param {T} initial
 * @param {'localStorage' | 'sessionStorage'} [area] the second lasts as long as the tab
 * @returns {import('@preact/signals').Signal<T>}
 */
export function stored(name, initial, area = 'localStorage') {
	const key = `touchline.${name}`;
	const value = signal(readStored(key, initial, area));
	effect(() => {
		try {
			globalThis[area].setItem(key, JSON.stringify(value.value));
		} catch {
			// Private windows may refuse; the setting then lasts as long as the page.
		}
	});
	// A record is written as a whole: what another tab has put into it would be lost with the next change here.
	if (area === 'localStorage' && typeof initial === 'object') {
		globalThis.addEventListener?.('storage', (event) => { if (event.key === key || event.key === null) value.value = readStored(key, initial, area); });
	}
	return value;
}

/**
 * @template T
 * @param {string} key @param {T} initial @param {'localStorage' | 'sessionStorage'} area
 * @returns {T}
 */
function readStored(key, initial, area) {
	try {
		const text = globalThis[area].getItem(key);
		const value = text === null ? initial : JSON.parse(text);
		return typeof value === typeof initial ? value : initial;
	} catch {
		return initial;
	}
}
