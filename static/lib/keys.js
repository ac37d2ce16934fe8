// @ts-check
/** The keyboard: one list of bindings for each page, from which the help is written too. */

/**
 * @typedef {object} Binding
 * @property {string[]} keys chords such as "a", "Ctrl+Enter", "Shift+1", "ArrowLeft"
 * @property {string} label what it does, in words
 * @property {string} group heading in the help
 * @property {(event: KeyboardEvent) => void} run
 * @property {string} [shown] how the help writes the keys, when not as they stand
 * @property {boolean} [typing] also works while a field has the focus
 * @property {() => boolean} [when] otherwise the key is left to the browser
 */

/** @type {Set<readonly Binding[]>} */
const scopes = new Set();

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

/** @param {EventTarget | null} target */
function isTyping(target) {
	if (!(target instanceof HTMLElement)) return false;
	if (target instanceof HTMLInputElement) {
		return !['checkbox', 'radio', 'button', 'range'].includes(target.type);
	}
	return target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement;
}

/** Enter and Space belong to the button or link that has the focus. @param {KeyboardEvent} event */
function isPress(event) {
	const pressable = event.target instanceof HTMLButtonElement
		|| event.target instanceof HTMLAnchorElement || event.target instanceof HTMLInputElement;
	return pressable && (event.key === 'Enter' || event.key === ' ') && !event.ctrlKey;
}

/** @param {KeyboardEvent} event */
function dispatch(event) {
	if (event.defaultPrevented || event.isComposing) return;
	if (document.querySelector('dialog[open]') || isPress(event)) return;
	const chord = chordOf(event);
	const typing = isTyping(event.target);
	// The newest scope wins.
	for (const bindings of [...scopes].reverse()) {
		const found = bindings.find((binding) => binding.keys.includes(chord));
		if (!found || (typing && !found.typing) || found.when?.() === false) continue;
		event.preventDefault();
		found.run(event);
		return;
	}
}

/** Listen to the keyboard. */
export function startKeys() {
	addEventListener('keydown', dispatch);
}
