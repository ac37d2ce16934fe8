// @ts-check
/** Listeners of fields and forms, called with what these hold. */

/** @param {(value: string) => void} tell @returns {(event: Event) => void} */
export function withValue(tell) {
	return ({ target }) => tell(/** @type {HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement} */ (target).value);
}

/** The number in a field; null where the field is empty. @param {string} text */
export function numberIn(text) {
	return text.trim() === '' ? null : Number(text);
}

/** @param {(ticked: boolean) => void} tell @returns {(event: Event) => void} */
export function withTick(tell) {
	return ({ target }) => tell(/** @type {HTMLInputElement} */ (target).checked);
}

/** Of a form that the browser itself sends nowhere. @param {(said: FormData, form: HTMLFormElement) => void} tell @returns {(event: Event) => void} */
export function withForm(tell) {
	return (event) => {
		event.preventDefault();
		const form = /** @type {HTMLFormElement} */ (event.currentTarget);
		tell(new FormData(form), form);
	};
}
