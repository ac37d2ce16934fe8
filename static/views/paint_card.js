// @ts-check
/** The paint of a dataset's pictures: how many were read, read them, take that back. */

import { html } from 'htm/preact';

import { getDatasetPaint, readDatasetPaint, revertPaint } from '../api/paint.js';
import { capital, count, plural } from '../lib/format.js';
import { matchName } from '../lib/match_name.js';
import { pageAddress } from './dataset_menu.js';
import { JobButton } from './job_button.js';
import { JobProgress } from './job_progress.js';
import { MatchHead, useMatchCard } from './match_card.js';
import { Trouble } from './page_frame.js';
import { Term } from './term.js';

/** @import {MatchPaintJson} from '../api/paint.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** Changes of groups after which pictures may have been read, or not fit any more. */
const CONCERNED = ['paint', 'import', 'edit', 'undo', 'redo', 'pitch', 'position'];

/** Pictures that reading would look at again, or for the first time. @param {MatchPaintJson} one */
function leftToRead({ views, without_picture: without, read, old, no_frame: gone }) {
	return Math.max(views - without - read, 0) + (old ?? 0) + gone;
}

/** All matches in one line. @param {{items: MatchPaintJson[]}} props */
function Numbers({ items }) {
	const sum = (/** @type {(one: MatchPaintJson) => number} */ of) => items.reduce((total, one) => total + of(one), 0);
	const numbers = [
		['views with lines', sum(({ views }) => views)], ['read', sum(({ read }) => read)], ['camera from paint', sum(({ painted }) => painted)],
		['too little paint', sum((one) => one.no_paint)], ['paint disagrees', sum((one) => one.paint_disagrees)],
		['to be read again', items.some(({ old }) => old === null) ? null : sum(({ old }) => old ?? 0)],
		['picture missing', sum((one) => one.no_frame)], ['without picture', sum((one) => one.without_picture)],
	];
	return html`<dl class="number-list paint-card__numbers">${numbers.map(([name, n]) => html`<div key=${name}><dt>${name}</dt><dd>${n === null ? '?' : count(Number(n))}</dd></div>`)}</dl>`;
}

/** @param {{one: MatchPaintJson, used: boolean, busy: boolean, onRead: () => void}} props */
function MatchPaint({ one, used, busy, onRead }) {
	const { name, aside } = matchName(one.match);
	return html`
		<tr>
			<${MatchHead} name=${name || 'no match'} aside=${aside} />
			<td>${capital(one.sentence)}</td>
			<td><span class="table__actions">
				${used && leftToRead(one) > 0 ? html`
					<${JobButton} busy=${busy} act=${onRead} kind="button--small" title="Read the pictures of this match">Read<span class="hidden-text"> ${name}</span><//>` : null}
			</span></td>
		</tr>`;
}

/** @param {{dataset: DatasetJson}} props */
export function PaintCard({ dataset }) {
	const { value, error, reload, card, saving } = useMatchCard(getDatasetPaint, dataset.id, CONCERNED, 'paint');
	const { job, busy, error: refused, send } = saving;
	if (error) return html`<${Trouble} title="The paint cannot be shown" error=${error} retry=${reload} />`;
	const items = value?.items.filter(({ views, read }) => views > 0 || read > 0) ?? [];
	const pictures = items.reduce((total, one) => total + one.views - one.without_picture, 0);
	if (!value || !items.length || !(value.used || pictures)) return null;
	const left = items.reduce((total, one) => total + leftToRead(one), 0);
	const isRead = items.some(({ read }) => read > 0);
	// Under another policy what was read once is still there, and can be seen.
	const isTold = value.used || isRead;
	return html`
		<section class="card card--flush statistics__matches paint-card" aria-labelledby="paint-title" ref=${card}>
			<h2 id="paint-title" tabindex="-1"><${Term} word="reading of paint">Paint of the pictures<//></h2>
			${isTold ? html`<${Numbers} items=${items} />` : null}
			${value.used ? html`
				<p class="buttons paint-card__actions">
					<${JobButton}
						busy=${busy} act=${() => send(() => readDatasetPaint(dataset.id, null))} kind=${left ? 'button--primary' : ''}
						title=${left ? `${plural(left, 'picture')} to read; the others are only checked` : 'Every picture is checked against its last reading'}
					>${isRead ? 'Read again' : 'Read the pictures'}<//>
					${isRead ? html`<${JobButton} busy=${busy} act=${() => send(() => revertPaint(dataset.id))} title="Restores the previous cameras of all groups">Undo the last reading<//>` : null}
				</p>` : html`
				<p class="paint-card__actions">The policy finds cameras from the lines alone; the paint of ${plural(pictures, 'picture')} could place them more exactly. <a class="link" href=${pageAddress(dataset.name, 'policy')}>Choose the policy <em>touchline</em></a>, then read the pictures here.</p>`}
			${job ? html`<div class="paint-card__actions"><${JobProgress} job=${job} /></div>` : null}
			${refused ? html`<p class="form__error paint-card__actions" role="alert">${refused}</p>` : null}
			${isTold ? html`<table class="table">
				<thead><tr><th>match</th><th>pictures</th><th><span class="hidden-text">actions</span></th></tr></thead>
				<tbody>${items.map((one) => html`
					<${MatchPaint} key=${one.match} one=${one} used=${value.used} busy=${busy} onRead=${() => send(() => readDatasetPaint(dataset.id, one.match))} />`)}
				</tbody>
			</table>` : null}
		</section>
	`;
}
