// @ts-check
/** Lines proposed for the views of a dataset without a camera: looked for, counted, forgotten. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { forgetProposals, getProposals, proposeForDataset } from '../api/proposals.js';
import { count, plural } from '../lib/format.js';
import { matchName } from '../lib/match_name.js';
import { queueAddress } from '../state/navigation.js';
import { announce } from '../state/notice.js';
import { JobProgress } from './job_progress.js';
import { MatchHead, useMatchCard } from './match_card.js';
import { Trouble } from './page_frame.js';
import { Term } from './term.js';

/** @import {MatchProposalsJson} from '../api/proposals.js' */
/** @import {JobJson} from '../api/jobs.js' */

/** Changes after which other views have a camera; of lines that stand there solving says it. */
const CONCERNED = ['import', 'edit', 'undo', 'redo', 'camera', 'station_edit', 'station_undo', 'station_redo', 'pitch', 'policy', 'solved'];
const OUTCOMES = /** @type {const} */ (['proposed', 'unsure', 'nothing']);

/** @param {{one: MatchProposalsJson, dataset: string}} props */
function MatchProposals({ one, dataset }) {
	const { name, aside } = matchName(one.match);
	return html`
		<tr data-match=${one.match}>
			<${MatchHead} name=${name || 'no match'} aside=${aside} />
			<td data-numeric="true">${count(one.views)}</td>
			${OUTCOMES.map((outcome) => html`
				<td key=${outcome} data-numeric="true" data-number=${outcome}>${one[outcome] ? html`
					<a href=${queueAddress(dataset, `proposal:${outcome} match:"${one.match}"`)}>${count(one[outcome])}</a>` : '0'}</td>`)}
			<td data-numeric="true" data-number="accepted">${count(one.accepted)}</td>
		</tr>`;
}

/** What a search that is over did, in words. @param {{job: JobJson}} props */
function Outcome({ job }) {
	const found = job.state === 'done' ? job.result : null;
	if (!found) return null;
	const parts = [
		`${plural(found.views, 'view')}: ${count(found.proposed)} proposed, ${count(found.unsure)} unsure, ${count(found.nothing)} with nothing found`,
		found.left ? `${count(found.left)} unchanged since the last search` : '',
		found.changed ? `${plural(found.changed, 'picture')} changed` : '',
		found.missing ? `${plural(found.missing, 'picture')} missing or unreadable` : '',
	];
	return html`<p role="status" data-result="proposals">${parts.filter(Boolean).join(' · ')}.</p>`;
}

/** @param {{dataset: number, name: string}} props */
export function Proposals({ dataset, name }) {
	const { value, error, reload, card, saving } = useMatchCard(getProposals, dataset, CONCERNED, 'proposals');
	const { job, busy, error: refused, send } = saving;
	const [problem, setProblem] = useState('');
	if (error) return html`<${Trouble} title="The proposals cannot be shown" error=${error} retry=${reload} />`;
	const items = (value?.items ?? []).filter(({ views, accepted }) => views || accepted);
	if (!value || (!items.length && !job)) return null;
	const [views, looked] = [sum(items, 'views'), sum(items, 'looked')];
	const why = busy ? 'Under way' : views ? '' : 'Every view with a picture has a camera, or waits to be solved';
	async function forget() {
		if (busy || !looked) return;
		setProblem('');
		try {
			const { forgotten } = await forgetProposals(dataset);
			announce(`${plural(forgotten, 'proposal')} deleted; lines that were accepted stay.`);
			card.current?.querySelector('h2')?.focus();
			reload();
		} catch (failed) {
			setProblem(sentenceOf(failed));
		}
	}
	return html`
		<section class="card card--flush statistics__matches proposals-card" aria-labelledby="proposals-title" ref=${card}>
			<h2 id="proposals-title" tabindex="-1"><${Term} word="proposal">Proposed lines<//></h2>
			<p>Touchline can propose lines, read from the painted lines in the picture, for views without a camera. A proposal is not used until a person accepts it, in review or in the calibration editor.</p>
			<table class="table">
				<thead><tr><th>match</th><th data-numeric="true">no camera</th><th data-numeric="true">proposed</th><th data-numeric="true">unsure</th><th data-numeric="true">nothing found</th><th data-numeric="true">accepted</th></tr></thead>
				<tbody>${items.map((one) => html`<${MatchProposals} key=${one.match} one=${one} dataset=${name} />`)}</tbody>
			</table>
			<p class="table__actions">
				<button data-needs="lead" class="button button--primary" type="button" aria-disabled=${why !== ''} title=${why || 'Views that have not changed since the last search are skipped'} onClick=${() => { if (!why) send(() => proposeForDataset(dataset)); }}>Propose lines for ${plural(views, 'view')}</button>
				<button data-needs="lead" class="button" type="button" aria-disabled=${busy || !looked} title=${busy ? 'Under way' : looked ? 'Lines that were accepted stay' : 'There are no proposals yet'} onClick=${forget}>Delete all proposals</button>
			</p>
			${job ? html`<${JobProgress} job=${job} /><${Outcome} job=${job} />` : null}
			${refused || problem ? html`<p class="form__error" role="alert">${refused || problem}</p>` : null}
		</section>
	`;
}

/** @param {MatchProposalsJson[]} items @param {'views' | 'looked'} what */
function sum(items, what) {
	return items.reduce((total, one) => total + one[what], 0);
}
