// @ts-check
/** Ctrl K: type where to go or what to do. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from 'preact/hooks';

import { withValue } from '../lib/field.js';
import { plural } from '../lib/format.js';
import { latest } from '../lib/latest.js';
import { navigate, page } from '../lib/router.js';
import { dataset, datasets, loadDatasets, useDataset } from '../state/datasets.js';
import { groupDocument } from '../state/group.js';
import { paletteOpen, takeTyped } from '../state/palette.js';
import { actionItems, groupItems, helpItems, matching } from '../state/palette_items.js';
import { DATASET_PAGES, pageAddress, plainPages } from './dataset_menu.js';

/** @import {DatasetJson} from '../api/types.js' */
/** @import {Item} from '../state/palette_items.js' */

const PAUSE = 120;
const KINDS = /** @type {const} */ (['Groups', 'Pages', 'Datasets', 'Actions']);

/** The dataset that the page speaks of. */
function present() {
	const name = page.value.page === 'review' ? groupDocument.value?.dataset.name : dataset.value?.name;
	return (datasets.value ?? []).find((one) => one.name === name) ?? dataset.value;
}

/** @param {DatasetJson | null} one @returns {Item[]} */
function pageItems(one) {
	const ofDataset = one ? DATASET_PAGES.map(({ name, label }) => ({ name, label, hint: one.name, href: pageAddress(one.name, name) })) : [];
	const plain = plainPages().map(({ name, label, href }) => ({ name, label, hint: '', href }));
	const review = { name: 'review', label: 'Review', hint: 'first group of the queue', href: '/review' };
	return [...ofDataset, review, ...plain].map(({ name, label, hint, href }) => ({
		id: `page-${name}`, kind: 'Pages', label, hint, run: () => navigate(href),
	}));
}

/** @returns {Item[]} */
function datasetItems() {
	return (datasets.value ?? []).map((one) => ({
		id: `dataset-${one.id}`, kind: 'Datasets', label: one.name, hint: plural(one.groups, 'group'),
		run: () => { useDataset(one.name); navigate(pageAddress(one.name, 'queue')); },
	}));
}

/** The groups of a dataset that answer to what is typed. @param {DatasetJson | null} one @param {string} text @returns {{groups: Item[], answered: boolean}} */
function useGroups(one, text) {
	const [{ groups, to }, setGroups] = useState({ groups: /** @type {Item[]} */ ([]), to: '' });
	const about = one?.name ?? '';
	const asking = useMemo(() => latest(PAUSE, async (/** @type {string} */ asked, signal) => {
		const found = one && asked ? await groupItems(one, asked, signal) : [];
		if (!signal.aborted) setGroups({ groups: found, to: `${about} ${asked}` });
	}), [about]);
	useEffect(() => {
		asking.run(text.trim());
		// A search that the server never answers must not keep the next one waiting.
		return asking.cancel;
	}, [asking, text]);
	return { groups, answered: to === `${about} ${text.trim()}` };
}

/** @param {{items: Item[], active: string, choose: (item: Item) => void}} props */
function Choices({ items, active, choose }) {
	const list = useRef(/** @type {HTMLDivElement | null} */ (null));
	useEffect(() => {
		list.current?.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: 'nearest' });
	}, [active]);
	return html`
		<div class="palette__list" id="palette-list" role="listbox" aria-label="Results" ref=${list}>
			${KINDS.map((kind) => {
				const found = items.filter((item) => item.kind === kind);
				return found.length === 0 ? null : html`
					<div role="group" key=${kind} aria-label=${kind}>
						<div class="palette__kind" role="presentation">${kind}</div>
						${found.map((item) => html`
							<div
								key=${item.id} id=${item.id} role="option" class="palette__item"
								aria-selected=${item.id === active} onClick=${() => choose(item)}
							><span>${item.label}</span><span class="palette__hint">${item.hint}</span></div>`)}
					</div>`;
			})}
		</div>
	`;
}

export function Palette() {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	const [text, setText] = useState('');
	const [place, setPlace] = useState(0);
	const [chosen, setChosen] = useState(false);
	const { groups, answered } = useGroups(present(), text);
	// The keys of the page below, as they were when the palette came up.
	const actions = useMemo(actionItems, []);
	useLayoutEffect(() => {
		dialog.current?.showModal();
		const typed = takeTyped();
		setText(typed.text);
		setChosen(typed.chosen);
	}, []);
	useEffect(() => { loadDatasets(); }, []);
	const fixed = matching([...pageItems(present()), ...helpItems(), ...datasetItems(), ...actions], text.trim());
	const all = [...groups, ...fixed];
	const [opening] = useState(paletteOpen.value);
	const items = KINDS.flatMap((kind) => all.filter((item) => item.kind === kind));
	const at = Math.max(0, Math.min(place, items.length - 1));
	/** @param {Item} item */
	function choose(item) {
		dialog.current?.close();
		paletteOpen.value = 0;
		item.run();
	}
	// What the server found for less than what is typed by now is not what is meant.
	const settled = datasets.value !== null && answered;
	useEffect(() => {
		if (chosen && settled && items[at]) choose(items[at]);
	}, [chosen, settled, items[at]?.id]);
	/** @param {KeyboardEvent} event */
	function key(event) {
		const steps = /** @type {{[key: string]: number}} */ ({ ArrowDown: 1, ArrowUp: -1, PageDown: 8, PageUp: -8 });
		if (event.key === 'Enter') setChosen(true);
		else if (steps[event.key]) setPlace(Math.max(0, Math.min(items.length - 1, at + steps[event.key])));
		else return;
		event.preventDefault();
	}
	return html`
		<dialog class="dialog palette" ref=${dialog} aria-label="Go to" onClose=${() => { if (paletteOpen.value === opening) paletteOpen.value = 0; }}>
			<input
				class="field palette__field" type="text" role="combobox" aria-label="Page, dataset, group or action"
				placeholder="Page, dataset, group or action" autocomplete="off" spellcheck=${false}
				aria-expanded="true" aria-controls="palette-list" aria-activedescendant=${items[at]?.id}
				value=${text} onKeyDown=${key}
				onInput=${withValue((typed) => {
					setText(typed);
					setPlace(0);
					setChosen(false);
				})}
			/>
			<${Choices} items=${items} active=${items[at]?.id ?? ''} choose=${choose} />
			${items.length === 0 ? html`<p class="empty-note" role="status">No result.</p>` : null}
		</dialog>
	`;
}
