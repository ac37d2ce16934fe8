// @ts-check
/** What shall be drawn: the ball, or one of the markings; those that are missing come first. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from 'preact/hooks';

import { plainMarking } from '../geometry/marking_words.js';
import { pitchMarkings } from '../geometry/pitch.js';
import { withValue } from '../lib/field.js';
import { chooseDrawing, endDrawing } from '../state/drawing.js';
import { drawing } from '../state/workspace.js';

/** @import {ViewPicture} from '../overlays/scene.js' */

/** @typedef {{marking: string | null, name: string, plain: string, note: string}} Choice   null: the ball */

/** Every marking's name; their order does not depend on the size of the pitch. */
const NAMES = [...pitchMarkings(105, 68).keys()].sort();

/** @param {ViewPicture} picture @returns {Choice[]} */
function choicesOf({ view, solved }) {
	const seen = new Set(solved?.calibration.markings.filter(({ polyline }) => polyline.length > 1).map(({ marking }) => marking));
	const rank = (/** @type {string} */ name) => (view.lines[name] ? 2 : seen.has(name) ? 0 : 1);
	const markings = NAMES.toSorted((a, b) => rank(a) - rank(b)).map((name) => ({
		marking: name, name, plain: plainMarking(name),
		note: view.lines[name] ? `${view.lines[name].length} drawn` : seen.has(name) ? 'visible, not drawn' : '',
	}));
	const ball = { marking: null, name: 'Ball', plain: '', note: view.balls.length ? 'draw again' : 'not drawn' };
	return view.balls.length ? [...markings, ball] : [ball, ...markings];
}

/** @param {{picture: ViewPicture}} props */
export function ClassChooser({ picture }) {
	const field = useRef(/** @type {HTMLInputElement | null} */ (null));
	const list = useRef(/** @type {HTMLUListElement | null} */ (null));
	const [text, setText] = useState('');
	const [at, setAt] = useState(0);
	const all = useMemo(() => choicesOf(picture), [picture.view.key, picture.view.lines]);
	const wanted = text.toLowerCase().split(/\s+/);
	const has = (/** @type {string} */ words) => wanted.every((word) => words.toLowerCase().includes(word));
	// Those with the words in their name come first.
	const found = all.filter(({ name, plain }) => has(`${name} ${plain}`)).toSorted((a, b) => Number(has(b.name)) - Number(has(a.name)));
	const active = Math.min(at, found.length - 1);
	const { letter } = picture.view;
	// Before the next key: who types at once must not find the letters doing something else.
	useLayoutEffect(() => field.current?.focus(), []);
	useEffect(() => list.current?.children[active]?.scrollIntoView({ block: 'nearest' }), [active]);
	/** @param {KeyboardEvent} event */
	function key(event) {
		const step = event.key === 'ArrowDown' ? 1 : event.key === 'ArrowUp' ? -1 : 0;
		if (step) setAt(Math.max(0, Math.min(found.length - 1, active + step)));
		else if (event.key === 'Enter' && found[active]) chooseDrawing(found[active].marking);
		else if (event.key === 'Escape') endDrawing();
		else return;
		event.preventDefault();
		event.stopPropagation();
	}
	return html`
		<div class="chooser" onKeyDown=${key}>
			<label class="hidden-text" for=${`draw-${letter}`}>What to draw in view ${letter}</label>
			<input
				id=${`draw-${letter}`} class="field chooser__field" ref=${field} value=${text} autocomplete="off" spellcheck=${false}
				placeholder="Ball or marking" role="combobox" aria-expanded="true" aria-controls=${`draw-list-${letter}`}
				aria-activedescendant=${found[active] ? `draw-${letter}-${active}` : undefined}
				onInput=${withValue((typed) => { setText(typed); setAt(0); })}
				onBlur=${(/** @type {FocusEvent} */ event) => {
					const { currentTarget, relatedTarget } = event;
					const inside = /** @type {HTMLElement} */ (currentTarget).parentElement?.contains(/** @type {Node | null} */ (relatedTarget));
					// A choice takes the field away too, and is no reason to stop.
					if (!inside && drawing.value?.what === 'ask') endDrawing();
				}}
			/>
			<ul class="chooser__list" id=${`draw-list-${letter}`} role="listbox" aria-label="Ball and markings" ref=${list}>
				${found.map(({ marking, name, plain, note }, i) => html`
					<li
						key=${name} id=${`draw-${letter}-${i}`} class="chooser__choice" role="option" aria-selected=${i === active}
						onPointerDown=${(/** @type {Event} */ event) => event.preventDefault()}
						onClick=${() => chooseDrawing(marking)}
					><span>${name} <span class="chooser__plain">${plain}</span></span><span class="chooser__note">${note}</span></li>`)}
				${found.length ? null : html`<li class="chooser__none" role="presentation">No marking has that name.</li>`}
			</ul>
		</div>
	`;
}
