// @ts-check
/** How the numbers of a dataset are spread; every bar leads to its groups. */

import { html } from 'htm/preact';
import { useRef } from 'preact/hooks';

import { getStatistics } from '../api/statistics.js';
import { count, plural } from '../lib/format.js';
import { matchName } from '../lib/match_name.js';
import { useResource } from '../lib/resource.js';
import { address, navigate, pageDataset, param } from '../lib/router.js';
import { noiseWords } from '../state/datasets.js';
import { COPIES } from '../state/me.js';
import { queueAddress } from '../state/navigation.js';
import { pageAddress } from './dataset_menu.js';
import { datasetPage } from './dataset_frame.js';
import { GoldCard } from './gold_card.js';
import { GuidelinesCard } from './guidelines_card.js';
import { HeatMap } from './heat_map.js';
import { MembersCard } from './members_card.js';
import { isContradicted, isNews, NoiseCard } from './noise_card.js';
import { Loading, Trouble } from './page_frame.js';
import { PaintCard } from './paint_card.js';
import { Pictures } from './pictures_card.js';
import { Pitches } from './pitches_card.js';
import { Positions } from './positions_card.js';
import { Proposals } from './proposals_card.js';
import { QueryBox } from './query_box.js';
import { seriesColour, Spread } from './spread.js';
import { WebhooksCard } from './webhooks_card.js';

/** @import {NoiseJson} from '../api/match_estimates.js' */
/** @import {MatchCounts, StatisticsJson} from '../api/statistics.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** @param {string} q */
function setQuery(q) {
	navigate(address(`/datasets/${encodeURIComponent(pageDataset.value)}/statistics`, { q: q.trim() }), { replace: true });
}

/** @param {{names: string[]}} props */
function SplitLegend({ names }) {
	if (names.length < 2) return null;
	return html`
		<p class="chart__legend" aria-label="Splits">
			${names.map((name, index) => html`<span key=${name}><i class="spread__swatch" data-colour=${seriesColour(index)} aria-hidden="true"></i>${name || 'no split'}</span>`)}
		</p>
	`;
}

/** @param {{matches: MatchCounts[], dataset: string, q: string}} props */
function Matches({ matches, dataset, q }) {
	return html`
		<section class="card card--flush statistics__matches" aria-labelledby="matches-title">
			<h2 id="matches-title">Matches · ${count(matches.length)}</h2>
			<table class="table">
				<thead><tr><th>match</th><th>split</th><th data-numeric="true">groups</th><th data-numeric="true">pass</th><th data-numeric="true">accepted</th></tr></thead>
				<tbody>${matches.map((one) => {
					const { name, aside } = matchName(one.match);
					return html`
						<tr key=${`${one.match} ${one.split}`}>
							<th scope="row"><a href=${queueAddress(dataset, `${q} match:"${one.match}"`.trim())}>${name || 'no match'}</a>${aside ? html`<small>${aside}</small>` : null}</th>
							<td>${one.split || '–'}</td><td data-numeric="true">${count(one.groups)}</td>
							<td data-numeric="true">${count(one.passing)}</td><td data-numeric="true">${count(one.accepted)}</td>
						</tr>`;
				})}
				</tbody>
			</table>
		</section>
	`;
}

/** Whether there is anything to show: few datasets have paint that was read. @param {StatisticsJson['histograms'][number]} spread */
function isWorthIt({ name, series }) {
	return name !== 'agreement' || series.some(({ counts }) => counts.some((count) => count > 0));
}

/** @param {{found: StatisticsJson, one: DatasetJson, q: string}} props */
function Body({ found, one, q }) {
	const dataset = one.name;
	const names = found.histograms[0]?.series.map(({ split }) => split) ?? [];
	return html`
		<div class="page__title"><p>${plural(found.groups, 'group')}${q ? (found.groups === 1 ? ' matches' : ' match') : ''}. Choose a bar to open its groups in the queue.</p><${SplitLegend} names=${names} /></div>
		<div class="statistics__grid">
			${found.histograms.filter(isWorthIt).map((spread) => html`<${Spread} key=${spread.name} spread=${spread} dataset=${dataset} q=${q} note=${spread.name === 'sigma' ? noiseWords(one.policy) : ''} />`)}
		</div>
		<div class="statistics__rest">
			<${HeatMap} positions=${found.positions} dataset=${dataset} q=${q} />
			<${Matches} matches=${found.matches} dataset=${dataset} q=${q} />
		</div>
	`;
}

/** @param {{one: DatasetJson}} props */
function StatisticsOf({ one }) {
	const q = param('q');
	const field = useRef(/** @type {HTMLInputElement | null} */ (null));
	const found = useResource((signal) => getStatistics(one.id, q, signal), [one.id, q]);
	return html`
		<div class="statistics__query"><${QueryBox} field=${field} invalid=${found.error?.status === 400} onQuery=${setQuery} /></div>
		${found.error ? html`<${Trouble} title=${found.error.status === 400 ? 'The query cannot be read' : 'The statistics cannot be shown'} error=${found.error} retry=${found.reload} />` : null}
		${found.value ? html`
			<${Body} found=${found.value} one=${one} q=${q} />
			<h2 class="statistics__whole">Whole dataset</h2>
			${one.id > COPIES ? null : html`<${MembersCard} dataset=${one.name} />`}
			<${GuidelinesCard} dataset=${one} />
			<${GoldCard} dataset=${one} />
			<${NoiseCard} dataset=${one.id}>
				${(/** @type {NoiseJson} */ noise) => (noise.advice.length === 0 ? null : html`
					<p class="note">
						${isNews(noise) ? html`${isContradicted(noise) ? 'The policy’s noise does not match this data' : 'The policy does not contradict this data, but the estimates are more exact'}: <a class="link" href=${pageAddress(one.name, 'policy')}>use the estimates</a> on the Policy page.` : 'The policy’s noise matches this data.'}</p>`)}
			<//>
			<${Pitches} dataset=${one.id} />
			<${Pictures} dataset=${one.id} />
			<${Positions} dataset=${one.id} />
			<${Proposals} dataset=${one.id} name=${one.name} />
			<${PaintCard} dataset=${one} />
			${one.id > COPIES ? null : html`<${WebhooksCard} dataset=${one} />`}` : found.error ? null : html`<${Loading} what="statistics" />`}
	`;
}

export const StatisticsPage = datasetPage('statistics', 'Statistics', StatisticsOf);
