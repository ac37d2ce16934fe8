// @ts-check
/** Were the pictures of each match's main camera stretched or cropped: estimated, said, taken back. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { getJobs } from '../api/jobs.js';
import { estimateMatchPictures, getMatchPictures, setMatchPicture } from '../api/match_estimates.js';
import { fixed, plural } from '../lib/format.js';
import { matchName } from '../lib/match_name.js';
import { useResource } from '../lib/resource.js';
import { JobButton } from './job_button.js';
import { MatchButton, MatchCard, MatchHead, useMatchCard } from './match_card.js';
import { Trouble } from './page_frame.js';
import { isNewPicture } from './picture_proposal.js';

/** @import {MatchPictureJson, PictureEstimateJson} from '../api/match_estimates.js' */
/** @import {PictureJson} from '../api/types.js' */

/** Changes of groups after which other pictures may be in use. */
const CONCERNED = ['import', 'edit', 'undo', 'redo'];
/** Below this many per cent, and this much of a half diagonal, nothing is said. */
const [LEAST_PERCENT, LEAST_SHIFT] = [0.05, 0.0005];

/** What was done to a picture, for people. @param {PictureJson | null} picture @returns {string} */
function pictureWords(picture) {
	if (!picture) return 'unchanged';
	const wide = 100 * (picture.aspect - 1), [right, down] = picture.shift;
	const said = [];
	if (Math.abs(wide) >= LEAST_PERCENT) said.push(`pixels ${fixed(Math.abs(wide), 1)} % ${wide > 0 ? 'wide' : 'narrow'}`);
	if (Math.max(Math.abs(right), Math.abs(down)) >= LEAST_SHIFT) said.push(`principal point ${fixed(right, 3)} right, ${fixed(down, 3)} down`);
	return said.join(', ') || 'changed; the amount is estimated from its lines';
}

/** @param {{one: MatchPictureJson, shown: PictureEstimateJson | undefined, busy: boolean, onSet: (picture: PictureJson | null) => void}} props */
function MatchPicture({ one, shown, busy, onSet }) {
	const { name, aside } = matchName(one.match);
	const proposed = shown?.proposed ?? null;
	const isNew = isNewPicture(one, proposed);
	return html`
		<tr>
			<${MatchHead} name=${name} aside=${aside} />
			<td>${one.mixed ? 'varies within the match' : pictureWords(one.picture)}</td>
			<td>${shown ? shown.sentence : '–'}${shown?.estimate && !proposed ? html`<small>not certain enough</small>` : null}</td>
			<td><span class="table__actions">
				${isNew ? html`
					<${MatchButton}
						name=${name} busy=${busy} act=${() => onSet(proposed)} kind="button--primary"
						title=${`Solve the ${plural(one.frames, 'picture')} of this main camera with ${pictureWords(proposed)}`}
					>Accept<//>` : null}
				${one.picture || one.mixed ? html`
					<${MatchButton} name=${name} busy=${busy} act=${() => onSet(null)} title="Treat the pictures as neither stretched nor cropped">Set to unchanged<//>` : null}
			</span></td>
		</tr>`;
}

/** @param {{dataset: number}} props */
export function Pictures({ dataset }) {
	const { value, error, reload, card, saving } = useMatchCard(getMatchPictures, dataset, CONCERNED, 'pictures');
	const { job, busy, error: refused, send } = saving;
	const [found, setFound] = useState(/** @type {PictureEstimateJson[] | null} */ (null));
	const before = useResource((signal) => getJobs({ dataset: String(dataset), kind: 'pictures', state: 'done', limit: 1 }, signal), [dataset]).value?.items[0];
	if (error) return html`<${Trouble} title="The pictures cannot be shown" error=${error} retry=${reload} />`;
	if (!value?.items.length) return null;
	const shown = job?.kind === 'pictures' && job.state === 'done' ? job.result.items : found ?? before?.result?.items ?? [];
	/** @param {() => Promise<import('../api/jobs.js').JobJson>} put */
	const ask = (put) => { if (!busy) { setFound(shown); send(put); } };
	const title = html`Stretched and cropped pictures
		<span class="card__aside"><${JobButton} busy=${busy} act=${() => ask(() => estimateMatchPictures(dataset))} kind="button--small" title="Estimate from up to thirty frames of each match together">Estimate<//></span>`;
	return html`
		<${MatchCard}
			id="pictures" title=${title} columns=${['in use', 'estimated from lines']} card=${card} refused=${refused}
			job=${job?.kind === 'pictures' && job.state === 'done' ? null : job}
			rows=${value.items.map((one) => html`
				<${MatchPicture}
					key=${one.match} one=${one} busy=${busy}
					shown=${shown.find((/** @type {PictureEstimateJson} */ { match }) => match === one.match)}
					onSet=${(/** @type {PictureJson | null} */ picture) => ask(() => setMatchPicture(dataset, one.match, picture))}
				/>`)}
			note=${html`<p class="note">For main cameras; a replay gets the finding “picture geometry” instead. Accept a proposal only if you know that the pictures were scaled or cropped: an unusual lens or pitch can look the same.</p>`}
		/>
	`;
}
