// @ts-check
/** How large each match's pitch is taken to be, what its lines show, and the size to accept. */

import { html } from 'htm/preact';

import { getPitches, setPitch } from '../api/pitches.js';
import { count } from '../lib/format.js';
import { matchName } from '../lib/match_name.js';
import { pitchSize, shownSize } from '../lib/pitch_size.js';
import { JobProgress } from './job_progress.js';
import { useMatchCard } from './match_card.js';
import { Trouble } from './page_frame.js';

/** @import {MatchPitchJson, PitchSizeJson} from '../api/pitches.js' */

/** Changes of groups after which other sizes may be in use or shown by the lines. */
const CONCERNED = ['pitch', 'import', 'solved'];

/**
 * @param {{one: MatchPitchJson, busy: boolean, onSet: (size: PitchSizeJson) => void}} props
 */
function MatchPitch({ one, busy, onSet }) {
	const { name, aside } = one.match ? matchName(one.match) : { name: 'groups without a match', aside: '' };
	/** @param {string} text @param {string} title @param {PitchSizeJson} size @param {string} kind */
	const button = (text, title, size, kind) => html`
		<button data-needs="lead" class=${`button button--small ${kind}`} type="button" aria-disabled=${busy} title=${busy ? 'Under way' : title} onClick=${() => { if (!busy) onSet(size); }}>${text}<span class="hidden-text"> for ${name}</span></button>`;
	const changed = one.previous !== null && (one.previous.length !== one.length || one.previous.width !== one.width);
	return html`
		<tr>
			<th scope="row">${name}${aside ? html`<small>${aside}</small>` : null}</th>
			<td>${one.mixed ? 'several sizes' : pitchSize(one)}</td>
			<td>${one.problem ?? shownSize(one.estimate)}</td>
			<td><span class="table__actions">
				${one.proposed ? button(`Use ${pitchSize(one.proposed)}`, `Solve the ${count(one.groups)} ${one.match ? 'groups of this match' : 'groups without a match'} on this pitch`, one.proposed, 'button--primary') : null}
				${one.previous && changed ? button('Take back', `Back to ${pitchSize(one.previous)}`, one.previous, '') : null}
			</span></td>
		</tr>`;
}

/** @param {{dataset: number}} props */
export function Pitches({ dataset }) {
	const { value, error, reload, card, saving } = useMatchCard(getPitches, dataset, CONCERNED);
	const { job, busy, error: refused, send } = saving;
	if (error) return html`<${Trouble} title="The pitches cannot be shown" error=${error} retry=${reload} />`;
	if (!value?.items.length) return null;
	const proposals = value.items.filter(({ proposed }) => proposed).length;
	return html`
		<section class="card card--flush statistics__matches" aria-labelledby="pitches-title" ref=${card}>
			<h2 id="pitches-title" tabindex="-1">Pitch sizes${proposals ? html` · ${count(proposals)} proposed` : null}</h2>
			<table class="table">
				<thead><tr><th>match</th><th>in use</th><th>lines show</th><th><span class="hidden-text">actions</span></th></tr></thead>
				<tbody>${value.items.map((one) => html`
					<${MatchPitch} key=${one.match} one=${one} busy=${busy} onSet=${(/** @type {PitchSizeJson} */ size) => send(() => setPitch(dataset, one.match, size, value.etag))} />`)}
				</tbody>
			</table>
			${job ? html`<${JobProgress} job=${job} />` : null}
			${refused ? html`<p class="form__error" role="alert">${refused}</p>` : null}
		</section>
	`;
}
