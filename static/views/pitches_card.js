// @ts-check
/** How large each match's pitch is taken to be, what its lines show, and the size to accept. */

import { html } from 'htm/preact';

import { estimatePitches, getPitches, setPitch } from '../api/match_estimates.js';
import { count } from '../lib/format.js';
import { matchName } from '../lib/match_name.js';
import { pitchSize, shownSize } from '../lib/pitch_size.js';
import { JobButton } from './job_button.js';
import { MatchButton, MatchCard, MatchHead, useMatchCard } from './match_card.js';
import { Trouble } from './page_frame.js';

/** @import {MatchPitchJson, PitchSizeJson} from '../api/match_estimates.js' */

/** Changes of groups after which other sizes may be in use or shown by the lines. */
const CONCERNED = ['pitch', 'import', 'solved'];

/**
 * @param {{one: MatchPitchJson, busy: boolean, onSet: (size: PitchSizeJson) => void}} props
 */
function MatchPitch({ one, busy, onSet }) {
	const { name, aside } = one.match ? matchName(one.match) : { name: 'groups without a match', aside: '' };
	const { proposed, previous } = one;
	const changed = previous !== null && (previous.length !== one.length || previous.width !== one.width);
	return html`
		<tr>
			<${MatchHead} name=${name} aside=${aside} />
			<td>${one.mixed ? 'varies within the match' : pitchSize(one)}</td>
			<td>${one.problem ?? shownSize(one.estimate)}</td>
			<td><span class="table__actions">
				${proposed ? html`
					<${MatchButton}
						name=${name} busy=${busy} act=${() => onSet(proposed)} kind="button--primary"
						title=${`Solve the ${count(one.groups)} ${one.match ? 'groups of this match' : 'groups without a match'} on this pitch`}
					>Use ${pitchSize(proposed)}<//>` : null}
				${previous && changed ? html`
					<${MatchButton} name=${name} busy=${busy} act=${() => onSet(previous)} title=${`Restore the previous pitch size, ${pitchSize(previous)}`}>Restore previous<//>` : null}
			</span></td>
		</tr>`;
}

/** @param {{dataset: number}} props */
export function Pitches({ dataset }) {
	const { value, error, reload, card, saving } = useMatchCard(getPitches, dataset, CONCERNED);
	const { job, busy, error: refused, send } = saving;
	if (error) return html`<${Trouble} title="The pitch sizes cannot be shown" error=${error} retry=${reload} />`;
	if (!value?.items.length) return null;
	const open = value.items.some(({ estimate, problem }) => !estimate && !problem);
	const proposals = value.items.filter(({ proposed }) => proposed).length;
	return html`
		<${MatchCard}
			id="pitches" title=${html`Pitch sizes${proposals ? html` · ${count(proposals)} proposed` : null}
				${open ? html`<span class="card__aside"><${JobButton} busy=${busy} act=${() => send(() => estimatePitches(dataset))} kind="button--small" title="Estimate the pitch of each match from its lines">Estimate<//></span>` : null}`}
			columns=${['in use', 'estimated from lines']} card=${card} job=${job} refused=${refused}
			rows=${value.items.map((one) => html`
				<${MatchPitch} key=${one.match} one=${one} busy=${busy} onSet=${(/** @type {PitchSizeJson} */ size) => send(() => setPitch(dataset, one.match, size, value.etag))} />`)}
		/>
	`;
}
