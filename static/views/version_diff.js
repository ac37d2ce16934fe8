// @ts-check
/** What changed from one version to another. */

import { html } from 'htm/preact';

import { sentenceOf } from '../api/problem.js';
import { getDiff } from '../api/versions.js';
import { count, fixed, plural, words } from '../lib/format.js';
import { matchName } from '../lib/match_name.js';
import { useResource } from '../lib/resource.js';
import { queueAddress } from '../state/navigation.js';
import { Loading } from './page_frame.js';

/** @import {ComponentChildren} from 'preact' */
/** @import {VersionJson} from '../api/versions.js' */

const SHOWN = 50;

/** @typedef {(item: any) => ComponentChildren} Tell */

/** @param {{title: string, items: any[], all: number, dataset: string, tell: Tell}} props */
function Part({ title, items, all, dataset, tell }) {
	if (all === 0) return null;
	return html`
		<details class="diff__part" open=${all <= 12}>
			<summary>${title} · ${count(all)}</summary>
			<table class="table">
				<tbody>${items.slice(0, SHOWN).map((item) => {
					const { name, aside } = matchName(item.group);
					return html`<tr key=${item.group}><th scope="row"><a href=${queueAddress(dataset, `key:"${item.group}"`)}>${name}</a>${aside ? html`<small>${aside}</small>` : null}</th><td>${tell(item)}</td></tr>`;
				})}
				</tbody>
			</table>
			${all > Math.min(SHOWN, items.length) ? html`<p class="note">The first ${Math.min(SHOWN, items.length)} of ${count(all)}.</p>` : null}
		</details>
	`;
}

/** @param {{diff: any, dataset: string}} props */
function Parts({ diff, dataset }) {
	const { counts } = diff;
	return html`
		<p>${words(diff.lines[0] ?? '')}</p>
		<ul class="diff__lines">${diff.lines.slice(1).map((/** @type {string} */ line) => html`<li key=${line}>${words(line)}</li>`)}</ul>
		<p class="note">${plural(counts.unchanged, 'group')} ${counts.unchanged === 1 ? 'is' : 'are'} the same in both.</p>
		<${Part} title="Added" items=${diff.added} all=${counts.added} dataset=${dataset} tell=${(/** @type {any} */ item) => `before: ${words(item.why)}`} />
		<${Part} title="Dropped" items=${diff.dropped} all=${counts.dropped} dataset=${dataset} tell=${(/** @type {any} */ item) => `now: ${words(item.why)}`} />
		<${Part} title="Moved balls" items=${diff.moved} all=${counts.moved} dataset=${dataset} tell=${(/** @type {any} */ item) => fixed(item.metres, 3, ' m')} />
		<${Part} title="Changed" items=${diff.changed} all=${counts.changed} dataset=${dataset} tell=${(/** @type {any} */ item) => item.what.map(words).join(', ')} />
	`;
}

/** @param {{older: VersionJson, newer: VersionJson, dataset: string, onClose: () => void}} props */
export function VersionDiff({ older, newer, dataset, onClose }) {
	const diff = useResource((signal) => getDiff(newer.id, older.id, signal), [newer.id, older.id]);
	return html`
		<section class="card" aria-labelledby="diff-title">
			<h2 id="diff-title">From ${older.name} to ${newer.name}
				<button class="card__aside link-button" type="button" onClick=${onClose}>Close<span class="hidden-text"> the comparison</span></button></h2>
			${diff.error ? html`<p class="form__error" role="alert">${sentenceOf(diff.error)}</p>` : null}
			${diff.value ? html`<${Parts} diff=${diff.value} dataset=${dataset} />` : diff.error ? null : html`<${Loading} what="the difference" />`}
		</section>
	`;
}
