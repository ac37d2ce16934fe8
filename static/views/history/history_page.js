// @ts-check
/** The history of a group: who said and did what, and what it changed in the pictures. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { listen } from '../../api/events.js';
import { getHistory } from '../../api/history.js';
import { useKeys } from '../../lib/hooks.js';
import { useResource } from '../../lib/resource.js';
import { navigate, page, param } from '../../lib/router.js';
import { load } from '../../state/documents.js';
import { isTeam } from '../../state/me.js';
import { reviewAddress } from '../../state/navigation.js';
import { isPictured, sentenceOfEntry } from '../../state/history_words.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { Term } from '../term.js';
import { When } from '../when.js';
import { BeforeAfter } from './before_after.js';

/** @import {LogEntryJson} from '../../api/history.js' */
/** @import {GroupDocument} from '../../api/types.js' */

/** @param {GroupDocument} group */
function lettersOf(group) {
	const letters = new Map(group.views.map(({ key, letter }) => [key, letter]));
	return (/** @type {string} */ key) => letters.get(key) ?? key;
}

/** @param {{entry: LogEntryJson, group: GroupDocument}} props */
function Entry({ entry, group }) {
	const [open, setOpen] = useState(param('entry') === String(entry.id));
	const said = sentenceOfEntry(entry, lettersOf(group));
	const who = entry.actor === 'local' && !isTeam ? 'You' : entry.actor;
	const head = html`<span class="past__what">${said}</span><span class="past__who">${who} · <${When} at=${entry.at} /></span>`;
	return html`
		<li class="past__entry" data-kind=${entry.kind} data-open=${open}>
			${isPictured(entry) ? html`<button class="past__head" type="button" aria-expanded=${open} onClick=${() => setOpen(!open)}>${head}</button>` : html`<div class="past__head">${head}</div>`}
			${open && isPictured(entry) ? html`<${BeforeAfter} group=${group.id} entry=${entry.id} />` : null}
		</li>
	`;
}

/** The button before or after the one that has the keyboard. @param {number} step */
function move(step) {
	const all = [.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll('button.past__head'))];
	const at = all.findIndex((one) => one === document.activeElement);
	all[Math.max(0, Math.min(all.length - 1, at + step))]?.focus();
}

/** @type {import('../../lib/keys.js').Binding[]} */
const KEYS = [
	{ keys: ['ArrowDown'], label: 'Next entry', group: 'History', repeats: true, run: () => move(1) },
	{ keys: ['ArrowUp'], label: 'Previous entry', group: 'History', repeats: true, run: () => move(-1) },
	{ keys: ['Escape'], label: 'Back to the group', group: 'History', run: () => { const at = page.value; if ('group' in at && at.group) navigate(reviewAddress(at.group)); } },
];

export function HistoryPage() {
	const at = page.value;
	const id = 'group' in at && at.group ? at.group : 0;
	useKeys(KEYS);
	const found = useResource(async (signal) => ({ group: await load(id), items: (await getHistory(id, signal)).items }), [id]);
	useEffect(() => listen('group', (told) => { if (told.group === id) found.reload(); }, found.reload), [id]);
	const group = found.value?.group;
	const where = group ? html`<a class="link" href=${reviewAddress(id)}>${group.label}</a>` : null;
	return html`
		<${PageFrame} current="history" of=${group?.dataset.name} title="History of a group" where=${where}>
			${found.error ? html`<${Trouble} title="The history cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${!found.value && !found.error ? html`<${Loading} what="the history" />` : null}
			${found.value && group ? html`
				<section class="card past" aria-labelledby="past-title">
					<h2 id="past-title">History of group ${group.number}<span class="past__legend"><i data-tone="before"></i>before <i data-tone="after"></i>after</span></h2>
					<ol class="past__entries">${[...found.value.items].reverse().map((entry) => html`<${Entry} key=${entry.id} entry=${entry} group=${group} />`)}</ol>
					<p class="note">Newest first. Open an entry to see what it changed; <kbd>↑</kbd> <kbd>↓</kbd> select an entry, <kbd>Esc</kbd> goes back to the group. The <${Term} word="audit">audit<//> lists the changes of all groups.</p>
				</section>` : null}
		<//>
	`;
}
