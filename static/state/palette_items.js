// @ts-check
/** What the palette finds: pages, datasets, groups and what can be done here. */

import { getGroups } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { activeBindings, keysOf, written } from '../lib/keys.js';
import { navigate } from '../lib/router.js';
import { reviewAddress } from './navigation.js';
import { openHelpAt } from './workspace.js';

/** @import {DatasetJson} from '../api/types.js' */
/** @import {Binding} from '../lib/keys.js' */

/**
 * @typedef {object} Item
 * @property {string} id
 * @property {'Pages' | 'Datasets' | 'Groups' | 'Actions'} kind
 * @property {string} label
 * @property {string} hint beside the label
 * @property {() => void} run
 */

const MOST = 8;

/** The parts of the help: name, label, and what else people may call it. */
export const HELP_PARTS = [
	{ name: 'keys', label: 'Keys', hint: 'help, shortcuts, keyboard' },
	{ name: 'legend', label: 'Legend', hint: 'help, colours, dashes, marks' },
	{ name: 'words', label: 'Glossary', hint: 'help, words, terms' },
	{ name: 'guide', label: 'Guide', hint: 'help, how to review' },
	{ name: 'practice', label: 'Practice', hint: 'help, learn on eight groups' },
];

/** Each part of the help opens over the page, so that nobody loses their place. @returns {Item[]} */
export function helpItems() {
	return HELP_PARTS.map(({ name, label, hint }) => ({
		id: `help-${name}`, kind: 'Pages', label, hint, run: () => openHelpAt(name),
	}));
}

/** What can be done on this page: its own keys. @returns {Item[]} */
export function actionItems() {
	const usable = activeBindings().filter((binding) => binding.shown !== 'hidden' && binding.when?.() !== false);
	return usable.map((binding, index) => ({
		id: `action-${index}`, kind: 'Actions', label: binding.label,
		hint: binding.shown ?? keysOf(binding).slice(0, 1).map(written).join(), run: () => press(binding),
	}));
}

/** @param {Binding} binding */
function press(binding) {
	binding.run(new KeyboardEvent('keydown', { key: binding.keys[0] }));
}

/**
 * Groups by number, or by words of their label.
 *
 * @param {DatasetJson} dataset @param {string} text @param {AbortSignal} signal
 * @returns {Promise<Item[]>}
 */
export async function groupItems(dataset, text, signal) {
	const q = /^\d+$/.test(text) ? `number:${text}` : text.replaceAll('"', '');
	try {
		const found = await getGroups({ dataset: dataset.name, q, limit: MOST }, signal);
		return found.items.map((row) => ({
			id: `group-${row.id}`, kind: 'Groups', label: `Group ${row.number}`, hint: row.label,
			run: () => navigate(reviewAddress(row.id, '')),
		}));
	} catch (error) {
		// Half a query is no query yet.
		if (signal.aborted || error instanceof ApiError) return [];
		throw error;
	}
}

/**
 * Those that hold every word, the ones that begin with the text first.
 *
 * @param {Item[]} items @param {string} text
 * @returns {Item[]}
 */
export function matching(items, text) {
	const asked = text.toLowerCase();
	const words = asked.split(/\s+/).filter(Boolean);
	const found = items.filter(({ label, hint }) => {
		const all = `${label} ${hint}`.toLowerCase();
		return words.every((word) => all.includes(word));
	});
	const first = (/** @type {Item} */ item) => Number(!item.label.toLowerCase().startsWith(asked));
	return found.sort((a, b) => first(a) - first(b));
}
