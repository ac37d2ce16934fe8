// @ts-check
/** Where a comment is written: Ctrl+Enter sends it, @ completes the names of people who see the group. What is not sent stays as a draft. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';

import { getPeopleOfGroup } from '../../api/threads.js';
import { useAttempt } from '../../lib/attempt.js';
import { completed, nameBefore } from '../../state/mentions.js';
import { commentDraft, keepCommentDraft } from '../../state/threads.js';
import { FormError } from '../form_error.js';

/** @typedef {{letter: string, view: string, at: {x: number, y: number}}} PlaceOfComment   image pixels */

/** Names that are offered at a time. */
const OFFERED = 6;
const LONGEST = 4000;

/** People by group; asked for once somebody types an @. @type {Map<number, Promise<string[]>>} */
const asked = new Map();

/** @param {number} group @returns {Promise<string[]>} */
function peopleOf(group) {
	const known = asked.get(group) ?? getPeopleOfGroup(group).then(({ names }) => names, () => { asked.delete(group); return []; });
	if (asked.size > 50) asked.clear();
	asked.set(group, known);
	return known;
}

/**
 * @param {{
 *   id: string, group: number, label: string, button: string, text?: string, focus?: unknown,
 *   send: (text: string) => Promise<unknown>, cancel?: () => void
 * }} props `focus`: takes the keyboard whenever it becomes another value
 */
export function CommentField({ id, group, label, button, text = '', focus, send, cancel }) {
	const field = useRef(/** @type {HTMLTextAreaElement | null} */ (null));
	const [names, setNames] = useState(/** @type {string[]} */ ([]));
	const [active, setActive] = useState(0);
	const { error, busy, attempt } = useAttempt();
	const [begun] = useState(() => commentDraft(group, id) || text);
	const keep = () => keepCommentDraft(group, id, field.current?.value ?? '');
	useLayoutEffect(() => { if (focus) field.current?.focus(); }, [focus]);
	// Buttons included, also once what was said above has grown.
	useEffect(() => { if (field.current && field.current === document.activeElement) field.current.form?.scrollIntoView({ block: 'nearest' }); });

	async function offer() {
		const at = field.current;
		const name = at && nameBefore(at.value, at.selectionStart);
		if (name === null || name === undefined) { setNames([]); return; }
		const people = await peopleOf(group);
		setNames(people.filter((one) => one.startsWith(name)).slice(0, OFFERED));
		setActive(0);
	}
	/** @param {string} name */
	function take(name) {
		const at = field.current;
		if (!at) return;
		const { value, caret } = completed(at.value, at.selectionStart, name);
		at.value = value;
		at.setSelectionRange(caret, caret);
		at.focus();
		keep();
		setNames([]);
	}
	/** @param {Event} [event] */
	function submit(event) {
		event?.preventDefault();
		const at = field.current;
		const written = at?.value ?? '';
		const said = written.trim();
		if (!at || !said || busy) { at?.focus(); return; }
		// What was typed meanwhile stays.
		attempt(send(said), () => {
			if (at.value.startsWith(written)) at.value = at.value.slice(written.length).trimStart();
			keepCommentDraft(group, id, at.value);
		});
	}
	/** @param {KeyboardEvent} event */
	function key(event) {
		const step = event.key === 'ArrowDown' ? 1 : event.key === 'ArrowUp' ? -1 : 0;
		if (names.length && step) setActive((active + step + names.length) % names.length);
		else if (names.length && (event.key === 'Enter' || event.key === 'Tab') && !event.ctrlKey) take(names[active]);
		else if (event.key === 'Enter' && (event.ctrlKey || event.metaKey)) submit();
		else if (event.key === 'Escape' && names.length) setNames([]);
		else if (event.key === 'Escape') { field.current?.blur(); cancel?.(); } else return;
		event.preventDefault();
		event.stopPropagation();
	}
	const list = `${id}-names`;
	return html`
		<form class="talk__form" onSubmit=${submit}>
			<label class="hidden-text" for=${id}>${label}</label>
			<textarea
				class="field talk__field" id=${id} ref=${field} rows="2" maxlength=${LONGEST} placeholder=${`${label}; @ mentions a person`} defaultValue=${begun}
				aria-autocomplete="list" aria-controls=${names.length ? list : undefined} aria-activedescendant=${names.length ? `${list}-${active}` : undefined}
				onInput=${() => { keep(); offer(); }} onKeyDown=${key} onBlur=${() => setTimeout(() => setNames([]), 150)}
			></textarea>
			${names.length ? html`
				<ul class="talk__names" id=${list} role="listbox" aria-label="People">
					${names.map((name, i) => html`<li key=${name} id=${`${list}-${i}`} role="option" aria-selected=${i === active} onPointerDown=${(/** @type {Event} */ event) => { event.preventDefault(); take(name); }}>@${name}</li>`)}
				</ul>` : null}
			${error ? html`<${FormError} error=${error} />` : null}
			<p class="talk__buttons">
				<button class="button button--small" type="submit" data-needs="annotate" aria-disabled=${busy}>${button} <kbd>Ctrl ⏎</kbd></button>
				${cancel ? html`<button class="button button--small" type="button" onClick=${() => { keepCommentDraft(group, id, ''); cancel(); }}>Cancel</button>` : null}
			</p>
		</form>
	`;
}
