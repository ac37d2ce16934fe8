// @ts-check
/** A long list of equal rows: only those in sight exist. */

import './environment.js';

import {
	elementScroll, observeElementOffset, observeElementRect, Virtualizer,
} from '@tanstack/virtual-core';
import { useEffect, useMemo, useReducer } from 'preact/hooks';

/**
 * @param {import('preact').RefObject<HTMLElement | null>} scroller
 * @param {{count: number, rowHeight: number, overscan?: number}} options
 * @returns {Virtualizer<HTMLElement, Element>}
 */
export function useVirtualList(scroller, { count, rowHeight, overscan = 8 }) {
	const [, redraw] = useReducer((/** @type {number} */ n) => n + 1, 0);
	/** @type {Virtualizer<HTMLElement, Element>} */
	const virtualizer = useMemo(() => new Virtualizer(options()), []);

	function options() {
		return {
			count,
			overscan,
			getScrollElement: () => scroller.current,
			estimateSize: () => rowHeight,
			initialOffset: () => scroller.current?.scrollTop ?? 0,
			scrollToFn: elementScroll,
			observeElementRect,
			observeElementOffset,
			onChange: () => redraw(0),
		};
	}

	virtualizer.setOptions(options());
	useEffect(() => virtualizer._didMount(), []);
	useEffect(() => virtualizer._willUpdate());
	return virtualizer;
}
