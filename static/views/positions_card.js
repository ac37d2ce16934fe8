// @ts-check
/** Where each match's main camera stands: shared with its pictures, renewed, taken back. */

import { html } from 'htm/preact';

import { getPositions, sharePositions, revertPositions } from '../api/match_estimates.js';
import { matchName } from '../lib/match_name.js';
import { MatchButton, MatchCard, MatchHead, useMatchCard } from './match_card.js';
import { Trouble } from './page_frame.js';

/** @import {MatchPositionJson} from '../api/match_estimates.js' */

/** Changes of groups after which positions may be others, or old. */
const CONCERNED = ['position', 'pitch', 'import', 'edit', 'undo', 'redo'];

/**
 * @param {{one: MatchPositionJson, used: boolean, busy: boolean, onShare: () => void, onBack: () => void}} props
 */
function MatchPosition({ one, used, busy, onShare, onBack }) {
	const { name, aside } = matchName(one.match);
	return html`
		<tr>
			<${MatchHead} name=${name} aside=${aside} />
			<td>${one.sentence}</td>
			<td><span class="table__actions">
				${used && one.current !== true ? html`
					<${MatchButton} name=${name} busy=${busy} act=${onShare} kind="button--primary" title="Solve the groups of this match with one common camera position">${one.current === null ? 'Share position' : 'Share position again'}<//>` : null}
				${one.current === null ? null : html`
					<${MatchButton} name=${name} busy=${busy} act=${onBack} title="Restore the camera position that was used before">Restore previous<//>`}
			</span></td>
		</tr>`;
}

/** @param {{dataset: number}} props */
export function Positions({ dataset }) {
	const { value, error, reload, card, saving } = useMatchCard(getPositions, dataset, CONCERNED, 'positions');
	const { job, busy, error: refused, send } = saving;
	if (error) return html`<${Trouble} title="The positions cannot be shown" error=${error} retry=${reload} />`;
	const items = value?.items.filter(({ current }) => value.used || current !== null) ?? [];
	if (!value || !items.length) return null;
	return html`
		<${MatchCard}
			id="positions" title="Main cameras" columns=${['position']} card=${card} job=${job} refused=${refused}
			rows=${items.map((one) => html`
				<${MatchPosition}
					key=${one.match} one=${one} used=${value.used} busy=${busy}
					onShare=${() => send(() => sharePositions(dataset, one.match))}
					onBack=${() => send(() => revertPositions(dataset, one.match))}
				/>`)}
			note=${value.used ? null : html`<p>The policy does not use these positions. To use them, switch on <em>Use the shared position of a match</em>.</p>`}
		/>
	`;
}
