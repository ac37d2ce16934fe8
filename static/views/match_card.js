// @ts-check
/** What cards with a row for each match share: they follow changes, and send theirs. */

import { useEffect, useRef } from 'preact/hooks';

import { listenToGroups } from '../api/events.js';
import { latest } from '../lib/latest.js';
import { useResource } from '../lib/resource.js';
import { useSavePolicy } from './save_policy.js';

/** What somebody else changed is shown after this many milliseconds at the latest. */
const PAUSE = 3000;

/**
 * @template T
 * @param {(dataset: number, signal: AbortSignal) => Promise<T>} get reads what the card shows
 * @param {number} dataset
 * @param {readonly string[]} concerned kinds of changes of groups after which it is read again
 */
export function useMatchCard(get, dataset, concerned) {
	const { value, error, reload } = useResource((signal) => get(dataset, signal), [dataset]);
	useEffect(() => {
		const reading = latest(PAUSE, async () => reload());
		const stop = listenToGroups((/** @type {{kind: string}} */ { kind }) => { if (concerned.includes(kind)) reading.run(null); }, () => reading.run(null));
		return () => { stop(); reading.cancel(); };
	}, [reload]);
	const card = useRef(/** @type {HTMLElement | null} */ (null));
	// The button that was pressed goes: whoever is still here, or nowhere, goes on from the heading.
	const saving = useSavePolicy(() => {
		const at = document.activeElement;
		if (!at || at === document.body || card.current?.contains(at)) card.current?.querySelector('h2')?.focus();
		reload();
	});
	return { value, error, reload, card, saving };
}
