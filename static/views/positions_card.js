// @ts-check
/** Where each match's main camera stands: shared with its pictures, renewed, taken back. */

import { html } from 'htm/preact';

import { getPositions, sharePositions, takePositionsBack } from '../api/positions.js';
import { matchName } from '../lib/match_name.js';
import { JobProgress } from './job_progress.js';
import { useMatchCard } from './match_card.js';
import { Trouble } from './page_frame.js';

/** @import {MatchPositionJson} from '../api/positions.js' */

/** Changes of groups after which positions may be others, or old. */
const CONCERNED = ['position', 'pitch', 'import', 'edit', 'undo', 'redo'];

/**
 * @param {{one: MatchPositionJson, used: boolean, busy: boolean, onShare: () => void, onBack: () => void}} props
 */
function MatchPosition({ one, used, busy, onShare, onBack }) {
	const { name, aside } = matchName(one.match);
	/** @param {string} text @param {string} title @param {() => void} act @param {string} kind */
	const button = (text, title, act, kind) => html`
		<button data-needs="lead" class=${`button button--small ${kind}`} type="button" aria-disabled=${busy} title=${busy ? 'Under way' : title} onClick=${() => { if (!busy) act(); }}>${text}<span class="hidden-text"> for ${name}</span></button>`;
	return html`
		<tr>
			<th scope="row">${name}${aside ? html`<small>${aside}</small>` : null}</th>
			<td>${one.sentence}</td>
			<td><span class="table__actions">
				${used && one.current !== true ? button(one.current === null ? 'Share' : 'Share again', 'Solve the groups of this match with it', onShare, 'button--primary') : null}
				${one.current === null ? null : button('Take back', 'Back to what it was before it was shared last', onBack, '')}
			</span></td>
		</tr>`;
}

/** @param {{dataset: number}} props */
export function Positions({ dataset }) {
	const { value, error, reload, card, saving } = useMatchCard(getPositions, dataset, CONCERNED);
	const { job, busy, error: refused, send } = saving;
	if (error) return html`<${Trouble} title="The positions cannot be shown" error=${error} retry=${reload} />`;
	const items = value?.items.filter(({ current }) => value.used || current !== null) ?? [];
	if (!value || !items.length) return null;
	return html`
		<section class="card card--flush statistics__matches" aria-labelledby="positions-title" ref=${card}>
			<h2 id="positions-title" tabindex="-1">Main cameras</h2>
			<table class="table">
				<thead><tr><th>match</th><th>position</th><th><span class="hidden-text">actions</span></th></tr></thead>
				<tbody>${items.map((one) => html`
					<${MatchPosition}
						key=${one.match} one=${one} used=${value.used} busy=${busy}
						onShare=${() => send(() => sharePositions(dataset, one.match))}
						onBack=${() => send(() => takePositionsBack(dataset, one.match))}
					/>`)}
				</tbody>
			</table>
			${value.used ? null : html`<p>The policy does not use them: it says so under <em>Use the position that the match shares</em>.</p>`}
			${job ? html`<${JobProgress} job=${job} />` : null}
			${refused ? html`<p class="form__error" role="alert">${refused}</p>` : null}
		</section>
	`;
}
