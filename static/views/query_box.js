// @ts-check
/** The query as text, with what may stand there offered below it. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';

import { param } from '../lib/router.js';
import { complete } from '../state/completion.js';
import { facets, loadFacets, queryFields } from '../state/facets.js';

/** @import {Completion, Offer} from '../state/completion.js' */

const TYPING_PAUSE = 250;
/** @type {Completion} */
const NOTHING = { from: 0, to: 0, offers: [] };

/** @param {{offers: Offer[], active: number, choose: (offer: Offer) => void}} props */
function Offers({ offers, active, choose }) {
	return html`
		<ul class="query-box__offers" id="query-offers" role="listbox" aria-label="Suggestions">
			${offers.map((offer, index) => html`
				<li
					key=${offer.text} id=${`query-offer-${index}`} role="option" aria-selected=${index === active}
					onPointerDown=${(/** @type {PointerEvent} */ event) => { event.preventDefault(); choose(offer); }}
				><span>${offer.label}</span><small>${offer.hint}</small></li>`)}
		</ul>
	`;
}

/** @param {{field: import('preact').RefObject<HTMLInputElement>, invalid: boolean, onQuery: (q: string) => void}} props */
export function QueryBox({ field, invalid, onQuery }) {
	const asked = param('q');
	const [text, setText] = useState(asked);
	/** The caret, as long as something is offered there. */
	const [at, setAt] = useState(/** @type {number | null} */ (null));
	/** The text of the chosen offer: offers may change while one chooses. */
	const [chosen, setChosen] = useState('');
	const caret = useRef(/** @type {number | null} */ (null));
	const typing = useRef(/** @type {ReturnType<typeof setTimeout> | undefined} */ (undefined));
	const { offers } = at === null ? NOTHING : complete(text, at, facets.value, queryFields.value);
	const active = offers.findIndex((one) => one.text === chosen);
	useEffect(() => {
		if (document.activeElement !== field.current) setText(asked);
	}, [asked]);
	// A layout effect: others are cleaned up after the next page is painted, and the query would lead back from there.
	useLayoutEffect(() => {
		// A word that still lacks its value is no question yet.
		if (text.trim() === asked || /[:<>=]$/.test(text)) return undefined;
		typing.current = setTimeout(() => onQuery(text), TYPING_PAUSE);
		return () => clearTimeout(typing.current);
	}, [text]);
	useEffect(() => {
		if (caret.current !== null) field.current?.setSelectionRange(caret.current, caret.current);
		caret.current = null;
	}, [text]);

	/** @param {HTMLInputElement | null} input */
	function offer(input) {
		setChosen('');
		setAt(input ? input.selectionStart ?? input.value.length : null);
	}
	/** @param {Offer} one */
	function choose(one) {
		// They may have typed on since this was drawn.
		const now = field.current?.value ?? text;
		const { from, to } = complete(now, field.current?.selectionStart ?? now.length, facets.value, queryFields.value);
		caret.current = from + one.text.length;
		setText(now.slice(0, from) + one.text + now.slice(to));
		setChosen('');
		setAt(caret.current);
	}
	/** @param {KeyboardEvent} event */
	function key(event) {
		if (event.key === 'ArrowDown' && offers.length === 0) offer(field.current);
		else if (event.key === 'ArrowDown' || event.key === 'ArrowUp') {
			// One place before the first: what was typed, taken as it is.
			const next = active + (event.key === 'ArrowDown' ? 1 : -1);
			setChosen(offers[next < -1 ? offers.length - 1 : next]?.text ?? '');
		} else if ((event.key === 'Enter' || event.key === 'Tab') && offers[active]) choose(offers[active]);
		else if (event.key === 'Enter') submit();
		else if (event.key === 'Escape' && offers.length) setAt(null);
		else if (event.key === 'Escape') field.current?.blur();
		else return;
		event.preventDefault();
	}
	function submit() {
		// Asked now: a moment later it would undo what was clicked since.
		clearTimeout(typing.current);
		onQuery(text);
		setAt(null);
		field.current?.blur();
	}
	return html`
		<div class="query-box">
			<input
				class="field field--query" type="text" role="combobox" ref=${field} value=${text} spellcheck=${false}
				aria-label="Query" placeholder="Query, such as status:unreviewed jac<0.95" autocomplete="off"
				aria-invalid=${invalid} aria-expanded=${offers.length > 0}
				aria-controls="query-offers" aria-activedescendant=${active >= 0 ? `query-offer-${active}` : undefined}
				onInput=${(/** @type {InputEvent} */ event) => {
					const input = /** @type {HTMLInputElement} */ (event.target);
					setText(input.value);
					offer(input);
				}}
				onFocus=${() => { loadFacets(); }} onBlur=${() => setAt(null)} onKeyDown=${key}
			/>
			${text ? html`
				<button class="query-box__clear" type="button" aria-label="Clear the query" onClick=${() => { setText(''); onQuery(''); }}>×</button>` : null}
			${offers.length > 0 ? html`<${Offers} offers=${offers} active=${active} choose=${choose} />` : null}
		</div>
	`;
}
