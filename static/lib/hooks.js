// @ts-check
/** Hooks that views share. */

import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';

import { bind } from './keys.js';

/** @import {Binding} from './keys.js' */

/**
 * The size of an element, followed.
 *
 * @template {HTMLElement} T
 * @returns {[import('preact').RefObject<T | null>, {width: number, height: number}]}
 */
export function useSize() {
	const ref = useRef(/** @type {T | null} */ (null));
	const [size, setSize] = useState({ width: 0, height: 0 });
	// Before the next paint: what was laid out for no size would be seen for a moment, and drawn twice.
	useLayoutEffect(() => {
		const element = ref.current;
		if (!element) return undefined;
		const observer = new ResizeObserver(([entry]) => {
			const { width, height } = entry.contentRect;
			setSize({ width: Math.floor(width), height: Math.floor(height) });
		});
		observer.observe(element);
		return () => observer.disconnect();
	}, []);
	return [ref, size];
}

/**
 * Key bindings that work while the component is shown.
 *
 * @param {readonly Binding[]} bindings the same array as long as nothing changed
 */
export function useKeys(bindings) {
	// Before the next paint: whoever types X 1 in one go must not find the 1 unbound.
	useLayoutEffect(() => bind(bindings), [bindings]);
}

/** The time, renewed so that "12 s ago" stays true. @param {number} interval ms */
export function useNow(interval) {
	const [now, setNow] = useState(Date.now());
	useEffect(() => {
		const timer = setInterval(() => setNow(Date.now()), interval);
		return () => clearInterval(timer);
	}, [interval]);
	return now;
}
