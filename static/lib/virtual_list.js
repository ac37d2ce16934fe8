// @ts-check
/** A long list of equal rows: only those in sight exist. */

import { useLayoutEffect, useReducer, useRef } from 'preact/hooks';

import { TallScroll } from './tall_scroll.js';

/** So long after the last scroll nobody scrolls any more, ms. */
const AT_REST = 150;
/** Seen before the element's size is known, px. */
const FIRST_SIGHT = 1000;

/**
 * @typedef {object} VirtualList
 * @property {number[]} rows indices of the rows to draw, in order
 * @property {(row: number) => number} placeOf where a row stands in the space, px
 * @property {number} space height of the element that stands for all rows, px
 * @property {() => number} top first pixel of the list in sight
 * @property {(top: number) => void} moveTo bring a pixel of the list to the top
 */

/**
 * @param {import('preact').RefObject<HTMLElement | null>} scroller
 * @param {{count: number, rowHeight: number, overscan?: number, onScroll?: (top: number) => void}} options
 * @returns {VirtualList}
 */
export function useVirtualList(scroller, { count, rowHeight, overscan = 8, onScroll }) {
	const [, redraw] = useReducer((/** @type {number} */ n) => n + 1, 0);
	const kept = useRef(/** @type {TallScroll | null} */ (null));
	const hear = useRef(onScroll);
	hear.current = onScroll;
	useLayoutEffect(() => {
		const element = scroller.current;
		if (!element) return undefined;
		const tall = new TallScroll(element);
		kept.current = tall;
		/** @type {ReturnType<typeof setTimeout> | undefined} */
		let rest;
		function scrolled() {
			tall.follow();
			hear.current?.(tall.top);
			redraw(0);
			clearTimeout(rest);
			rest = setTimeout(() => { tall.settle(); redraw(0); }, AT_REST);
		}
		const sized = new ResizeObserver(() => redraw(0));
		sized.observe(element);
		element.addEventListener('scroll', scrolled, { passive: true });
		redraw(0);
		return () => {
			clearTimeout(rest);
			sized.disconnect();
			element.removeEventListener('scroll', scrolled);
		};
	}, []);
	const tall = kept.current;
	if (tall) tall.height = count * rowHeight;
	const top = tall?.top ?? 0;
	const seen = scroller.current?.clientHeight || FIRST_SIGHT;
	const first = Math.max(0, Math.floor(top / rowHeight) - overscan);
	const last = Math.min(count - 1, Math.floor((top + seen) / rowHeight) + overscan);
	return {
		rows: Array.from({ length: Math.max(0, last - first + 1) }, (_, place) => first + place),
		placeOf: (row) => row * rowHeight - (tall?.base ?? 0),
		space: tall?.space ?? count * rowHeight,
		top: () => kept.current?.top ?? 0,
		moveTo: (place) => { kept.current?.moveTo(place); redraw(0); },
	};
}
