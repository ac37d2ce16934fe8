// @ts-check
/**
 * Words that explain themselves: whatever has `data-term` shows what the glossary says of it, on hover, focus or touch.
 *
 * One tooltip serves the whole page. It lies in the top layer, so nothing moves and nothing cuts it off.
 */

import { html } from 'htm/preact';

import { loadGlossary, meaningOf } from '../state/glossary.js';

/** @import {ComponentChildren} from 'preact' */

/** Milliseconds that a pointer rests on a word before it is explained, and may leave it on its way to the tip. */
const REST = 350;
const LEAVE = 150;
const ID = 'term-tip';
const GAP = 6;

/** @type {HTMLElement | null} */
let tip = null;
/** @type {HTMLElement | null} */
let told = null;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/**
 * A word that can be asked about. Buttons need none of this: they take `data-term` themselves.
 *
 * @param {{word: string, children?: ComponentChildren}} props `word`: its id in the glossary
 */
export function Term({ word, children }) {
	return html`<span class="term" tabindex="0" data-term=${word}>${children}</span>`;
}

/** @param {EventTarget | null} target @returns {HTMLElement | null} */
function termOf(target) {
	return target instanceof Element ? /** @type {HTMLElement | null} */ (target.closest('[data-term]')) : null;
}

/** @returns {HTMLElement} */
function theTip() {
	if (tip) return tip;
	tip = document.createElement('div');
	tip.id = ID;
	tip.className = 'term-tip';
	tip.setAttribute('role', 'tooltip');
	tip.setAttribute('popover', 'manual');
	document.body.append(tip);
	return tip;
}

/** @param {HTMLElement} term */
async function show(term) {
	clearTimeout(timer);
	if (told === term) return;
	hide();
	told = term;
	const meaning = await meaningOf(term.dataset.term ?? '').catch(() => '');
	// Somebody may have gone on while the words were on their way.
	if (told !== term || !term.isConnected) return;
	if (!meaning) {
		told = null;
		return;
	}
	const box = theTip();
	box.textContent = meaning;
	term.setAttribute('aria-describedby', ID);
	box.showPopover();
	place(box, term.getBoundingClientRect());
}

/** Below the word, or above it where there is no room. @param {HTMLElement} box @param {DOMRect} at */
function place(box, at) {
	const { width, height } = box.getBoundingClientRect();
	const below = at.bottom + GAP + height < innerHeight;
	box.style.left = `${Math.max(GAP, Math.min(at.left, innerWidth - width - GAP))}px`;
	box.style.top = `${below ? at.bottom + GAP : Math.max(GAP, at.top - GAP - height)}px`;
}

function hide() {
	clearTimeout(timer);
	if (!told) return;
	told.removeAttribute('aria-describedby');
	told = null;
	if (tip?.matches(':popover-open')) tip.hidePopover();
}

/** @param {PointerEvent} event */
function over(event) {
	if (event.pointerType === 'touch') return;
	const term = termOf(event.target);
	if (term) {
		clearTimeout(timer);
		timer = setTimeout(() => show(term), told === term ? 0 : REST);
	} else if (event.target === tip) clearTimeout(timer);
	else if (told && told !== document.activeElement) {
		clearTimeout(timer);
		timer = setTimeout(hide, LEAVE);
	} else if (!told) clearTimeout(timer);
}

/** @param {FocusEvent} event */
function focus(event) {
	const term = termOf(event.target);
	// A click focuses, too, and means something else.
	if (term?.matches(':focus-visible')) show(term);
	else hide();
}

/** @param {PointerEvent} event */
function tap(event) {
	const term = termOf(event.target);
	if (event.pointerType !== 'touch') return;
	if (term && term !== told) show(term);
	else hide();
}

/** @param {KeyboardEvent} event */
function key(event) {
	if (event.key !== 'Escape' || !tip?.matches(':popover-open')) return;
	hide();
	event.preventDefault();
	event.stopImmediatePropagation();
}

/** Explain words from now on; returns the way to stop. */
export function explainTerms() {
	const control = new AbortController();
	const options = { signal: control.signal };
	addEventListener('pointerover', over, options);
	addEventListener('click', /** @type {EventListener} */ (tap), options);
	addEventListener('focusin', focus, options);
	addEventListener('focusout', hide, options);
	addEventListener('keydown', key, { ...options, capture: true });
	addEventListener('scroll', hide, { ...options, capture: true, passive: true });
	addEventListener('resize', hide, options);
	// The words are there before somebody asks.
	const ahead = setTimeout(() => { loadGlossary().catch(() => {}); }, 3000);
	return () => {
		clearTimeout(ahead);
		control.abort();
		hide();
	};
}
