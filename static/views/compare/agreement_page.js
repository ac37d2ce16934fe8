// @ts-check
/** How far the people of a dataset agree, and which groups wait for somebody to decide. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { agreementFile, getAgreement, getWaiting, putLimits } from '../../api/agreement.js';
import { ApiError, sentenceOf } from '../../api/problem.js';
import { getIndependentAnnotations } from '../../api/independent_annotations.js';
import { getBatches } from '../../api/work.js';
import { numberIn, withValue } from '../../lib/field.js';
import { fixed, plural, words } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { pageDataset } from '../../lib/router.js';
import { queueAddress, reviewAddress } from '../../state/navigation.js';
import { whyNot } from '../../state/rights.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { When } from '../when.js';

/** @import {IndependentAnnotationJson} from '../../api/independent_annotations.js' */
/** @import {AgreementJson, CoefficientJson, GroupAgreementJson, LimitsJson, PeopleAgreementJson, SpreadJson, WaitingJson} from '../../api/agreement.js' */

/** So many rows of a table are drawn. */
const MOST_ROWS = 200;

/** @param {CoefficientJson | null} one */
function coefficient(one) {
	if (!one) return '–';
	if (one.value === null) return one.items === 0 ? '–' : `all the same (${one.items})`;
	const interval = one.low === null ? '' : ` [${fixed(one.low, 2)}, ${fixed(one.high, 2)}]`;
	return `${fixed(one.value, 2)}${interval}`;
}

/** The middle and the bad end. @param {SpreadJson} one @param {number} digits */
const spread = (one, digits) => (one.count === 0 ? '–' : `${fixed(one.median, digits)} · ${fixed(one.tail, digits)}`);

/** @param {{dataset: string}} props */
function WaitingCard({ dataset }) {
	const found = useResource((signal) => getWaiting(dataset, signal), [dataset]);
	const items = found.value?.items ?? [];
	if (found.error) return html`<${Trouble} title="The list cannot be shown" error=${found.error} retry=${found.reload} />`;
	return html`
		<section class="card card--flush" aria-labelledby="agreement-waiting">
			<h2 id="agreement-waiting">To decide<span class="card__aside">${found.value ? plural(items.length, 'group') : ''}</span></h2>
			${found.value && items.length === 0 ? html`<p class="agreement__text">Nothing to decide. Groups appear here when their independent annotations differ by more than the limits.</p>` : null}
			${items.length > 0 ? html`
				<p class="agreement__text"><a class="button button--primary" href=${`/adjudicate/${items[0].group}`}>Decide the worst one</a></p>
				<div class="table__scroll" tabindex="0" role="region" aria-label="Groups that wait for a decision">
					<table class="table">
						<thead><tr><th>group</th><th>annotated by</th><th data-numeric="true">differences</th><th data-numeric="true">largest, × its limit</th><th>waiting since</th></tr></thead>
						<tbody>${items.map((/** @type {WaitingJson} */ one) => html`
							<tr key=${`${one.group} ${one.batch}`}>
								<th scope="row"><a href=${`/adjudicate/${one.group}`}>${one.number}</a></th><td>${one.people.join(', ')}</td>
								<td data-numeric="true">${one.disagreements}</td><td data-numeric="true">${fixed(one.worst, 1)}</td><td><${When} at=${one.since} /></td>
							</tr>`)}</tbody>
					</table>
				</div>` : null}
		</section>
	`;
}

/** @param {{one: PeopleAgreementJson, name: string}} props */
function PeopleRow({ one, name }) {
	const { spreads } = one;
	return html`
		<tr>
			<th scope="row">${name}</th><td data-numeric="true">${one.groups}</td><td data-numeric="true">${coefficient(one.kappa)}</td>
			<td data-numeric="true">${spread(spreads.line_px, 1)}</td><td data-numeric="true">${spread(spreads.ball_px, 1)}</td>
			<td data-numeric="true">${spread(spreads.ball_m, 2)}</td><td data-numeric="true">${spread(spreads.jac, 2)}</td><td data-numeric="true">${spread(spreads.position_m, 2)}</td>
		</tr>
	`;
}

/** Whether the annotations of a group agree, and nobody has judged it. @param {GroupAgreementJson} one */
function isUnjudged({ state, status }) {
	return state === 'agreed' && status === 'unreviewed';
}

/** @param {{found: AgreementJson, dataset: string, batch: number | null}} props */
function PeopleCard({ found, dataset, batch }) {
	const unjudged = found.groups.filter(isUnjudged).length;
	return html`
		<section class="card card--flush" aria-labelledby="agreement-people">
			<h2 id="agreement-people">Agreement<span class="card__aside">median · 95th percentile, of JaC the 5th</span></h2>
			<p class="agreement__text">Groups whose annotations agree (the first one is used): ${found.agreed}${unjudged ? html` (<a class="link" href=${queueAddress(dataset, 'annotations:agreed status:unreviewed')}>${unjudged} without a verdict</a>)` : null}; decided: ${found.decided}; waiting for a decision: ${found.open}. Krippendorff’s α of the verdicts: ${coefficient(found.alpha)}.</p>
			<div class="table__scroll" tabindex="0" role="region" aria-label="Agreement by pair of people">
				<table class="table">
					<thead><tr><th>people</th><th data-numeric="true">groups</th><th data-numeric="true">verdicts, κ</th><th data-numeric="true">lines, px</th><th data-numeric="true">ball, px</th><th data-numeric="true">3D ball, m</th><th data-numeric="true">JaC</th><th data-numeric="true">cameras, m</th></tr></thead>
					<tbody>
						<${PeopleRow} one=${found.overall} name="all" />
						${found.pairs.map((one) => html`<${PeopleRow} key=${one.people.join(' ')} one=${one} name=${one.people.join(' and ')} />`)}
					</tbody>
				</table>
			</div>
			<p class="agreement__text"><a class="button" href=${agreementFile(dataset, batch)} download>CSV</a></p>
		</section>
	`;
}

const LIMITS = /** @type {{name: keyof LimitsJson, label: string, step: string}[]} */ ([
	{ name: 'line_px', label: 'lines, px', step: 'any' }, { name: 'markings', label: 'markings drawn by only one person', step: '1' },
	{ name: 'ball_px', label: 'ball centre, px', step: 'any' }, { name: 'diameter_px', label: 'ball diameter, px', step: 'any' },
	{ name: 'ball_m', label: '3D ball, m', step: 'any' }, { name: 'jac', label: 'lowest JaC', step: 'any' },
]);

/** @param {{limits: LimitsJson, dataset: string, saved: () => void}} props */
function LimitsCard({ limits, dataset, saved }) {
	const [edited, setEdited] = useState(/** @type {{[name in keyof LimitsJson]: number | null}} */ (limits));
	const [said, setSaid] = useState('');
	/** @param {SubmitEvent} event */
	async function save(event) {
		event.preventDefault();
		try {
			// The browser sends no form with an empty field.
			await putLimits(dataset, /** @type {LimitsJson} */ (edited));
			setSaid('Saved. They apply to annotations submitted from now on.');
			saved();
		} catch (error) {
			if (!(error instanceof ApiError)) throw error;
			setSaid(sentenceOf(error));
		}
	}
	return html`
		<section class="card" aria-labelledby="agreement-limits">
			<h2 id="agreement-limits">Limits</h2>
			<p>Annotations agree when they have the same verdict and differ by no more than this. The first annotation of a group whose annotations agree is used automatically, with the verdict that they gave. Without a verdict in the annotations, the group waits in the queue for one.</p>
			<form class="agreement__limits" onSubmit=${save}>
				${LIMITS.map(({ name, label, step }) => html`
					<label key=${name}><span>${label}</span><input class="field"
						type="number" min="0" step=${step} required value=${edited[name] ?? ''}
						onInput=${withValue((text) => setEdited({ ...edited, [name]: numberIn(text) }))}
					/></label>`)}
				<button class="button" type="submit">Save limits</button>
			</form>
			<p role="status">${said}</p>
		</section>
	`;
}

/** Whose annotation is used, and who chose it or continued from it. @param {GroupAgreementJson} one */
function takenText({ taken, state, outcome, decided_by: by }) {
	const way = outcome === 'start' ? 'continued' : 'chosen';
	if (state === 'decided') return `${taken}’s annotation, ${way} by ${by}`;
	return outcome === 'start' ? `${taken}’s annotation, ${way}` : `${taken}’s annotation`;
}

/** @param {{one: GroupAgreementJson}} props */
function GroupRow({ one }) {
	const link = one.state === 'open' ? `/adjudicate/${one.group}` : reviewAddress(one.group);
	const said = one.people.map((name, place) => `${name} ${words(one.verdicts[place] ?? 'none')}`).join(', ');
	return html`
		<tr>
			<th scope="row"><a href=${link}>${one.number}</a></th><td>${said}</td>
			<td>${one.state}${isUnjudged(one) ? ', no verdict' : ''}${one.taken ? html`<small>${takenText(one)}</small>` : null}</td>
			<td data-numeric="true">${one.disagreements}</td><td data-numeric="true">${spread(one.spreads.line_px, 1)}</td>
			<td data-numeric="true">${spread(one.spreads.ball_px, 1)}</td><td data-numeric="true">${fixed(one.spreads.ball_m.median, 2)}</td><td data-numeric="true">${spread(one.spreads.jac, 2)}</td>
		</tr>
	`;
}

/** @param {{found: AgreementJson}} props */
function GroupsCard({ found }) {
	return html`
		<section class="card card--flush" aria-labelledby="agreement-groups">
			<h2 id="agreement-groups">Groups, most disagreement first<span class="card__aside">${plural(found.groups.length, 'group')}</span></h2>
			<div class="table__scroll" tabindex="0" role="region" aria-label="Groups, most disagreement first">
				<table class="table">
					<thead><tr><th>group</th><th>verdicts</th><th>result</th><th data-numeric="true">differences</th><th data-numeric="true">lines, px</th><th data-numeric="true">ball, px</th><th data-numeric="true">3D ball, m</th><th data-numeric="true">JaC</th></tr></thead>
					<tbody>${found.groups.slice(0, MOST_ROWS).map((one) => html`<${GroupRow} key=${`${one.group} ${one.batch}`} one=${one} />`)}</tbody>
				</table>
			</div>
			${found.groups.length > MOST_ROWS ? html`<p class="agreement__text">The CSV file has all of them.</p>` : null}
		</section>
	`;
}

/** @param {IndependentAnnotationJson} one */
function stateOf({ submitted: handed, settled, returned: back }) {
	if (settled) return html`<span title="This annotation, or another one of the same group, is used">done</span> <small><${When} at=${settled} /></small>`;
	if (handed) return html`<strong>submitted</strong> <small><${When} at=${handed} /></small>`;
	return back ? html`returned by ${back.by}${back.reason ? html`<small>“${back.reason}”</small>` : null}` : 'in progress';
}

/** Everybody's own annotations, those that a lead can do something about first. @param {{dataset: string, batch: number | null}} props */
function TakesCard({ dataset, batch }) {
	const found = useResource((signal) => getIndependentAnnotations(dataset, signal), [dataset]);
	const items = (found.value?.items ?? []).filter((one) => batch === null || (one.batch ?? 0) === batch);
	if (found.error) return html`<${Trouble} title="The annotations cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (items.length === 0) return null;
	/** @param {IndependentAnnotationJson} one */
	const rank = (one) => (one.settled ? 2 : one.submitted ? 0 : 1);
	const sorted = items.toSorted((a, b) => rank(a) - rank(b) || b.id - a.id);
	return html`
		<section class="card card--flush" aria-labelledby="agreement-takes">
			<h2 id="agreement-takes">Independent annotations<span class="card__aside">${plural(items.length, 'annotation')}</span></h2>
			<p class="agreement__text">Open an annotation to apply it to its group, or to return it to its annotator.</p>
			<div class="table__scroll agreement__takes" tabindex="0" role="region" aria-label="Independent annotations">
				<table class="table">
					<thead><tr><th>group</th><th>person</th><th>verdict</th><th>state</th></tr></thead>
					<tbody>${sorted.slice(0, MOST_ROWS).map((one) => html`
						<tr key=${one.id}><th scope="row"><a href=${reviewAddress(one.group)}>${one.number === null ? one.title : `${one.number} · ${one.title}`}</a></th><td>${one.person}</td><td>${words(one.verdict ?? '–')}</td><td>${stateOf(one)}</td></tr>`)}</tbody>
				</table>
			</div>
			${items.length > MOST_ROWS ? html`<p class="agreement__text">The first ${MOST_ROWS} of ${items.length}; choose a batch to see its own.</p>` : null}
		</section>
	`;
}

/** Which batch is looked at. @param {{dataset: string, batch: number | null, choose: (batch: number | null) => void}} props */
function BatchChoice({ dataset, batch, choose }) {
	const found = useResource((signal) => getBatches(dataset, signal), [dataset]);
	const several = (found.value?.items ?? []).filter(({ verdicts }) => verdicts > 1);
	if (several.length === 0) return null;
	return html`
		<p class="agreement__choice"><label for="agreement-batch">Results of</label>
			<select class="field" id="agreement-batch" value=${batch ?? ''} onChange=${withValue((text) => choose(text === '' ? null : Number(text)))}>
				<option value="">all groups, with and without a batch</option>
				${several.map(({ id, name, state }) => html`<option key=${id} value=${id}>${name}${state === 'closed' ? ' (closed)' : ''}</option>`)}
				<option value="0">groups without a batch</option>
			</select></p>
	`;
}

/** What leads see besides. @param {{dataset: string}} props */
function LeadCards({ dataset }) {
	const [batch, setBatch] = useState(/** @type {number | null} */ (null));
	const found = useResource((signal) => getAgreement(dataset, signal, batch), [dataset, batch]);
	if (found.error) return html`<${Trouble} title="The agreement between annotators cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (!found.value) return html`<${Loading} what="the agreement" />`;
	return html`
		<${BatchChoice} dataset=${dataset} batch=${batch} choose=${setBatch} />
		${found.value.groups.length > 0 ? html`<${PeopleCard} found=${found.value} dataset=${dataset} batch=${batch} /><${GroupsCard} found=${found.value} />` : html`<p class="agreement__none">No annotations are compared yet${batch === null ? '' : ' here'}. Assign groups to several annotators (<em>Assign…</em> in the queue, <em>Annotators per group</em>), or press <kbd>Shift O</kbd> in a group.</p>`}
		<${TakesCard} dataset=${dataset} batch=${batch} />
		<${LimitsCard} key=${dataset} limits=${found.value.limits} dataset=${dataset} saved=${found.reload} />
	`;
}

export function AgreementPage() {
	const dataset = pageDataset.value;
	return html`
		<${PageFrame} current="agreement" title=${`Agreement in ${dataset}`} where=${html`<strong>${dataset}</strong> <span class="header__place">Agreement</span>`}>
			<${WaitingCard} dataset=${dataset} />
			${whyNot('lead', dataset) === '' ? html`<${LeadCards} dataset=${dataset} />` : null}
		<//>
	`;
}
