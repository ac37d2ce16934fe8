// @ts-check
/** Scrolling through more than browsers draw: they cap the height of an element. */

/**
 * Highest element, px. Firefox draws nothing beyond 17.8 million, Chromium nothing beyond 33; from 8
 * on, places are no longer whole pixels everywhere, for they are 32 bit numbers.
 */
export const HIGHEST = 4_000_000;
/** A scroll by more than so many heights of what is seen is a jump: somebody drags the bar. */
const JUMP = 3;
/** Within so many heights of an end of the list the element has exactly as far to go as the list. */
const NEAR = 10;

/**
 * @typedef {object} Scroller what is asked of the element
 * @property {number} scrollTop
 * @property {number} clientHeight
 */

/**
 * The place in a list that is higher than the element which stands for it.
 *
 * Wheel and keys move through the list pixel by pixel; the bar stands for the list as a whole.
 * Where the element has come to its end and the list has not, or when nobody scrolls any more, the
 * bar is moved to where it belongs, and what is seen stays where it is.
 */
export class TallScroll {
	/** Where the element's own top lies in the list, px, before what it is scrolled by. */
	base = 0;
	#height = 0;
	#last = 0;

	/** @param {Scroller} element */
	constructor(element) {
		this.element = element;
	}

	/** Of the whole list, px. */
	get height() {
		return this.#height;
	}

	set height(height) {
		this.#height = height;
		if (!this.isTall) this.base = 0;
	}

	/** Whether the list is higher than the element that stands for it. */
	get isTall() {
		return this.#height > HIGHEST;
	}

	/** Of the element that stands for the list, px. */
	get space() {
		return Math.min(this.height, HIGHEST);
	}

	/** First pixel of the list in sight. */
	get top() {
		return this.element.scrollTop + this.base;
	}

	/** Bring a pixel of the list to the top, as near as can be. @param {number} top */
	moveTo(top) {
		const place = Math.max(0, Math.min(top, this.#reach(this.height)));
		this.element.scrollTop = this.isTall ? this.#standingFor(place) : place;
		this.#last = this.element.scrollTop;
		if (this.isTall) this.base = place - this.#last;
	}

	/** Understand what the element was scrolled by. */
	follow() {
		const now = this.element.scrollTop;
		const by = Math.abs(now - this.#last);
		this.#last = now;
		if (!this.isTall) return;
		if (by > JUMP * this.element.clientHeight) {
			this.base = Math.round(now / this.#reach(this.space) * this.#reach(this.height)) - now;
		} else if (this.#atAnEnd(now)) this.moveTo(this.top);
	}

	/** Move the bar to where it belongs. */
	settle() {
		if (this.isTall) this.moveTo(this.top);
	}

	/** What the element is scrolled by where the list is at a pixel. @param {number} place */
	#standingFor(place) {
		const reach = this.#reach(this.space);
		const left = this.#reach(this.height) - place;
		const near = NEAR * this.element.clientHeight;
		// Whole pixels: browsers round what an element is scrolled by, and rows would tremble.
		const share = Math.round(place / this.#reach(this.height) * reach);
		return Math.max(Math.min(place, near), Math.min(share, reach - Math.min(left, near)));
	}

	/** Whether the element has no way left where the list may have. @param {number} now */
	#atAnEnd(now) {
		const { clientHeight } = this.element;
		return now < clientHeight || now > this.#reach(this.space) - clientHeight;
	}

	/** How far something can be scrolled. @param {number} height */
	#reach(height) {
		return Math.max(height - this.element.clientHeight, 1);
	}
}
