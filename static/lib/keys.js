// @ts-check
/** The keyboard: one list of bindings for each page, from which the help is written too. */

import { stored } from './storage.js';

/**
 * @typedef {object} Binding
 * @property {string[]} keys chords such as "a", "Ctrl+Enter", "Shift+1", "ArrowLeft"
 * @property {string} label what it does, in words
 * @property {string} group heading in the help
 * @property {(event: KeyboardEvent) => void} run
 * @property {string} [shown] how the help writes the keys, when not as they stand
 * @property {boolean} [typing] also works while a field has the focus
 * @property {() => boolean} [when] otherwise the key is left to the browser
 * @property {{start: () => void, end: () => void}} [hold] what holding the key does; `run` is then
 *   the tap, and comes when the key is let go
 * @property {boolean} [repeats] a key held down does it again and again; without it, once
 * @property {import('../api/people.js').Action} [needs] what somebody must be allowed to do
 */

/** @type {Set<readonly Binding[]>} */
const scopes = new Set();

/** Whether single letters do anything; they surprise whoever speaks to the computer. */
export const lettersOn = stored('keys-letters', true);

/** Keys that the person chose, by `idOf` a binding. */
export const chosenKeys = stored('keys-chosen', /** @type {Record<string, string[]>} */ ({}));

/** Every binding that works now. @returns {Binding[]} */
export function activeBindings() {
	return [...scopes].flat();
}

/**
 * Let bindings work until the returned function is called.
 *
 * @param {readonly Binding[]} bindings
 * @returns {() => void}
 */
export function bind(bindings) {
	scopes.add(bindings);
	return () => { scopes.delete(bindings); };
}

/** The name under which a person's choice for a binding is kept. @param {Binding} binding */
export function idOf({ group, label }) {
	return `${group}: ${label}`;
}

/** The keys that do it now: the person's, else ours. @param {Binding} binding @returns {string[]} */
export function keysOf(binding) {
	const chosen = chosenKeys.value[idOf(binding)];
	return chosen ?? binding.keys;
}

/** Whether a person may choose other keys for it. @param {Binding} binding */
export function isEditable(binding) {
	return binding.shown === undefined && binding.keys.length > 0 && !binding.keys.includes('Escape');
}

/**
 * Take another key for a binding; null: ours again.
 *
 * @param {Binding} binding @param {string | null} chord
 * @returns {Binding | null} who has that key already, in which case nothing changes
 */
export function chooseKey(binding, chord) {
	const holder = chord === null ? undefined : activeBindings().find((other) => (
		idOf(other) !== idOf(binding) && keysOf(other).includes(chord)
	));
	if (holder) return holder;
	const { [idOf(binding)]: _, ...rest } = chosenKeys.value;
	chosenKeys.value = chord === null ? rest : { ...rest, [idOf(binding)]: [chord] };
	return null;
}

/**
 * The chord of a key event: modifiers in the order Ctrl, Alt, Shift, then the key.
 *
 * Shift is named only with keys that Shift does not change into another character.
 *
 * @param {{key: string, code: string, ctrlKey: boolean, metaKey: boolean, altKey: boolean, shiftKey: boolean}} event
 * @returns {string}
 */
export function chordOf(event) {
	const digit = /^(?:Digit|Numpad)(\d)$/.exec(event.code);
	let key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
	// With Shift or Alt a digit key gives another character on most layouts.
	if (digit && (event.shiftKey || event.altKey)) key = digit[1];
	const named = key.length > 1 || /[a-z0-9]/.test(key);
	const parts = [];
	if (event.ctrlKey || event.metaKey) parts.push('Ctrl');
	if (event.altKey) parts.push('Alt');
	if (event.shiftKey && named) parts.push('Shift');
	return [...parts, key].join('+');
}

/** Whether a chord is a letter alone, with or without Shift. @param {string} chord */
export function isLetter(chord) {
	return /^(?:Shift\+)?\p{L}$/u.test(chord);
}

const SYMBOLS = /** @type {Record<string, string>} */ ({
	Escape: 'Esc', Delete: 'Del', ArrowUp: '↑', ArrowDown: '↓', ArrowLeft: '←', ArrowRight: '→',
	Backspace: '⌫', ' ': 'Space',
});

/** A chord as it stands on the keys. @param {string} chord */
export function written(chord) {
	return chord.split('+').map((key) => SYMBOLS[key] ?? (key.length === 1 ? key.toUpperCase() : key)).join(' ');
}

/** @param {EventTarget | null} target */
function isTyping(target) {
	if (!(target instanceof HTMLElement)) return false;
	if (target instanceof HTMLInputElement) {
		return !['checkbox', 'radio', 'button', 'range'].includes(target.type);
	}
	return target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement;
}

/** Enter and Space belong to the button, field or summary that has the focus, Enter to a link. @param {KeyboardEvent} event */
function isPress(event) {
	if (event.ctrlKey) return false;
	if (event.target instanceof HTMLAnchorElement) return event.key === 'Enter';
	const pressable = event.target instanceof HTMLButtonElement || event.target instanceof HTMLInputElement
		|| (event.target instanceof HTMLElement && event.target.tagName === 'SUMMARY');
	return pressable && (event.key === 'Enter' || event.key === ' ');
}

/** Arrows move a slider that has the focus. @param {KeyboardEvent} event */
function isSliding(event) {
	return event.target instanceof HTMLInputElement && event.target.type === 'range'
		&& /^(?:Arrow|Page|Home|End)/.test(event.key);
}

/** @param {KeyboardEvent} event */
function dispatch(event) {
	if (event.defaultPrevented || event.isComposing) return;
	// A browser presses the button that has the focus again and again while Enter is down.
	if (event.repeat && event.key === 'Enter' && isPress(event)) event.preventDefault();
	if (document.querySelector('dialog[open], [popover]:popover-open:not([role="tooltip"])') || isPress(event) || isSliding(event)) return;
	const chord = chordOf(event);
	if (!lettersOn.value && isLetter(chord)) return;
	const typing = isTyping(event.target);
	// The newest scope wins.
	for (const bindings of [...scopes].reverse()) {
		const found = bindings.find((binding) => (
			keysOf(binding).includes(chord) && (!typing || binding.typing) && binding.when?.() !== false
		));
		if (!found) continue;
		event.preventDefault();
		if (found.needs && refused(found.needs)) return;
		if (found.hold) press(found, event);
		else if (!event.repeat || found.repeats) found.run(event);
		return;
	}
}

/** How long a key is down before it counts as held. */
const HOLD = 260;

/** @type {{code: string, binding: Binding, timer: ReturnType<typeof setTimeout>, held: boolean} | null} */
let pressed = null;

/** @param {Binding} binding @param {KeyboardEvent} event */
function press(binding, event) {
	if (event.repeat || pressed) return;
	const timer = setTimeout(() => {
		if (pressed) pressed.held = true;
		binding.hold?.start();
	}, HOLD);
	pressed = { code: event.code, binding, timer, held: false };
}

/** The key that is down was let go. @param {KeyboardEvent} event */
function release(event) {
	if (pressed?.code !== event.code) return;
	const { binding, timer, held } = pressed;
	pressed = null;
	clearTimeout(timer);
	if (held) binding.hold?.end();
	else binding.run(event);
}

/** Another window has the keyboard now: nothing is held any more. */
function letGo() {
	if (!pressed) return;
	clearTimeout(pressed.timer);
	if (pressed.held) pressed.binding.hold?.end();
	pressed = null;
}

/** @type {(needs: import('../api/people.js').Action) => boolean} */
let refused = () => false;

/** Listen to the keyboard. @param {typeof refused} [refuses] whether somebody may not do that, in which case they are told */
export function startKeys(refuses = () => false) {
	refused = refuses;
	addEventListener('keydown', dispatch);
	addEventListener('keyup', release);
	addEventListener('blur', letGo);
}
