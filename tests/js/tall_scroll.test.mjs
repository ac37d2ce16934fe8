import assert from 'node:assert/strict';
import { test } from 'node:test';

import { HIGHEST, TallScroll } from '../../static/lib/tall_scroll.js';

const SEEN = 600;

/** An element as browsers scroll it: within its space, in whole pixels. */
function opened(height) {
	const element = {
		clientHeight: SEEN,
		place: 0,
		get scrollTop() { return this.place; },
		set scrollTop(to) { this.place = Math.max(0, Math.min(Math.round(to), scroll.space - SEEN)); },
	};
	const scroll = new TallScroll(element);
	scroll.height = height;
	const wheel = (by) => { element.scrollTop += by; scroll.follow(); };
	return { element, scroll, wheel };
}

test('a list that browsers can draw is scrolled as it is', () => {
	const { element, scroll, wheel } = opened(100_000);
	wheel(90_000);
	assert.equal(scroll.space, 100_000);
	assert.equal(scroll.top, 90_000);
	scroll.moveTo(12);
	assert.equal(element.scrollTop, 12);
	assert.equal(scroll.base, 0);
});

test('the space of a higher list stays below what browsers draw, and every pixel can be reached', () => {
	const { scroll } = opened(72_000_000);
	assert.equal(scroll.space, HIGHEST);
	for (const top of [0, 1, 333, 7_200_000, 36_000_001, 71_999_399, 71_999_400]) {
		scroll.moveTo(top);
		assert.equal(scroll.top, top);
	}
	scroll.moveTo(1e9);
	assert.equal(scroll.top, 72_000_000 - SEEN);
});

test('the wheel moves a higher list pixel by pixel, from its beginning on and to its end', () => {
	const { scroll, wheel } = opened(72_000_000);
	let top = 0;
	for (let turn = 0; turn < 300; turn++) {
		wheel(120);
		top += 120;
		assert.equal(scroll.top, top);
		if (turn % 7 === 0) scroll.settle();
	}
	scroll.moveTo(72_000_000 - SEEN - 5000);
	for (let turn = 0; turn < 60; turn++) wheel(120);
	assert.equal(scroll.top, 72_000_000 - SEEN);
	for (let turn = 0; turn < 60; turn++) wheel(-120);
	assert.equal(scroll.top, 72_000_000 - SEEN - 7200);
});

test('scrolling back ends at the first pixel', () => {
	const { scroll, wheel } = opened(72_000_000);
	scroll.moveTo(9000);
	for (let turn = 0; turn < 100; turn++) wheel(-120);
	assert.equal(scroll.top, 0);
});

test('the bar dragged to the middle shows the middle, and to the end the end', () => {
	const { element, scroll, wheel } = opened(72_000_000);
	wheel((HIGHEST - SEEN) / 2);
	assert.ok(Math.abs(scroll.top - (72_000_000 - SEEN) / 2) < 20);
	wheel(HIGHEST);
	assert.equal(scroll.top, 72_000_000 - SEEN);
	wheel(-HIGHEST);
	assert.equal(scroll.top, 0);
	assert.equal(element.scrollTop, 0);
});

test('once nobody scrolls the bar stands where the list is, and what is seen stays', () => {
	const { element, scroll, wheel } = opened(72_000_000);
	for (let turn = 0; turn < 1000; turn++) wheel(1000);
	const { top } = scroll;
	assert.equal(top, 1_000_000);
	scroll.settle();
	assert.equal(scroll.top, top);
	assert.ok(Math.abs(element.scrollTop / (HIGHEST - SEEN) - top / (72_000_000 - SEEN)) < 1e-6);
});

test('a list that becomes shorter is scrolled as it is again', () => {
	const { scroll } = opened(72_000_000);
	scroll.moveTo(50_000_000);
	scroll.height = 7200;
	scroll.element.scrollTop = 720;
	scroll.follow();
	assert.equal(scroll.top, 720);
});
