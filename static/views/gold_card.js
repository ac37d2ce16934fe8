// @ts-check
/** Gold groups, and how far each person is from what is true of them: for leads. */

import { html } from 'htm/preact';

import { deleteGold, getGold, patchGold } from '../api/independent_annotations.js';
import { useAttempt } from '../lib/attempt.js';
import { withValue } from '../lib/field.js';
import { plural } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { reviewAddress } from '../state/navigation.js';
import { whyNot } from '../state/rights.js';
import { FormError } from './form_error.js';
import { Term } from './term.js';

/** @import {DatasetJson} from '../api/types.js' */
/** @import {GoldGroupJson, GoldResultJson, MedianIntervalJson, PersonResultsJson} from '../api/independent_annotations.js' */

/** What annotators of a gold group may begin with. */
export const STARTS = [['imported', 'the imported annotations'], ['without_balls', 'lines without balls'], ['bare', 'pictures only']];
/** Where the truth of a group is from. */
const FROM = { verdict: 'its annotations at the time it was marked', sample: 'the values it was generated from', version: 'a frozen version' };
const WIDE = 160, HIGH = 28;

/** A median with its interval; few numbers have none. @param {MedianIntervalJson} one @param {number} digits */
function middleText({ count, median, low, high }, digits) {
	if (median === null) return '–';
	const of = low === null || high === null ? `${count} only` : `${low.toFixed(digits)} to ${high.toFixed(digits)}`;
	return `${median.toFixed(digits)} (${of})`;
}

/** Pixels of the lines over time, oldest at the left. @param {{results: GoldResultJson[], person: string}} props */
function Course({ results, person }) {
	const values = results.map(({ error }) => error.line_px ?? error.ball_px).filter((value) => value !== null);
	if (values.length < 2) return html`<span>–</span>`;
	const top = Math.max(...values) || 1;
	const places = values.map((value, index) => `${(index / (values.length - 1)) * (WIDE - 4) + 2},${HIGH - 2 - (value / top) * (HIGH - 4)}`);
	return html`
		<svg class="gold__course" viewBox=${`0 0 ${WIDE} ${HIGH}`} width=${WIDE} height=${HIGH} role="img" aria-label=${`${person}: ${values.map((value) => value.toFixed(1)).join(', ')} px, oldest first`}>
			<polyline points=${places.join(' ')} />
		</svg>`;
}

/** @param {{one: PersonResultsJson}} props */
function Person({ one }) {
	const share = one.judged === 0 ? '–' : `${one.right} of ${one.judged} (${Math.round(100 * (one.right_low ?? 0))} to ${Math.round(100 * (one.right_high ?? 1))} %)`;
	const again = one.results.filter(({ submissions }) => submissions > 1).length;
	return html`
		<tr>
			<th scope="row">${one.person}</th>
			<td data-numeric="true">${one.results.length}${again > 0 ? html` <span title=${`${plural(again, 'group')} submitted again after a lead returned it; the first submission is measured`}>(${again} again)</span>` : null}</td>
			<td data-numeric="true">${middleText(one.line_px, 1)}</td>
			<td data-numeric="true">${middleText(one.ball_px, 1)}</td>
			<td data-numeric="true">${middleText(one.ball_m, 2)}</td>
			<td data-numeric="true">${share}</td>
			<td><${Course} results=${one.results} person=${one.person} /></td>
		</tr>`;
}

/** @param {{one: GoldGroupJson, change: (start: string) => void, drop: () => void}} props */
function GoldRow({ one, change, drop }) {
	return html`
		<tr>
			<th scope="row"><a href=${reviewAddress(one.group)}>${one.label}</a></th>
			<td><select class="field" aria-label=${`What annotators of ${one.label} begin with`} value=${one.start} onChange=${withValue(change)}>
				${STARTS.map(([name, words]) => html`<option key=${name} value=${name}>${words}</option>`)}
			</select></td>
			<td>${FROM[one.source]}</td>
			<td>${one.marked_by}</td>
			<td><button class="button button--small" type="button" onClick=${drop}>Unmark</button></td>
		</tr>`;
}

/** @param {{dataset: DatasetJson}} props */
export function GoldCard({ dataset }) {
	const may = whyNot('lead', dataset.name) === '';
	const { value, error, reload } = useResource(async (signal) => (may ? getGold(dataset.id, signal) : null), [dataset.id, may]);
	const { error: refused, attempt } = useAttempt();
	/** @param {Promise<unknown>} doing */
	const told = (doing) => attempt(doing).then(reload);
	if (!may || (!value && !error)) return null;
	return html`
		<section class="card card--flush" aria-labelledby="gold-title">
			<h2 id="gold-title"><${Term} word="gold-group">Gold groups<//></h2>
			${error || refused ? html`<${FormError} error=${error ?? refused} />` : null}
			<p class="gold__about">${value?.groups.length ? `${plural(value.groups.length, 'group')} with known truth.` : 'None yet.'} Review a group, then choose <em>Mark as gold group</em> in the command palette (<kbd>Ctrl K</kbd>); or let <em>Assign…</em> use groups of a sample or a version. Batches mix them in without marking them.</p>
			<p class="gold__about">While a batch is open, its annotators see neither the originals of its groups nor gold groups, every copy starts with the same kind of content, and their first submission is measured. People may still remember a frame or find it in another dataset: make gold groups of frames that the annotators have not seen.</p>
			${value?.people.length ? html`
				<div class="table__scroll" tabindex="0" role="region" aria-label="People and gold groups"><table class="table">
					<thead><tr><th>Person</th><th data-numeric="true">groups</th><th data-numeric="true">lines, px</th><th data-numeric="true">ball, px</th><th data-numeric="true">ball, m</th><th data-numeric="true">correct verdicts</th><th>over time</th></tr></thead>
					<tbody>${value.people.map((one) => html`<${Person} key=${one.person} one=${one} />`)}</tbody>
				</table></div>
				<p class="gold__about">Medians of the distance from the truth, with an interval of 95 %; fewer than six groups have none.</p>` : null}
			${value?.groups.length ? html`
				<div class="table__scroll" tabindex="0" role="region" aria-label="Gold groups"><table class="table">
					<thead><tr><th>Group</th><th>A copy starts with</th><th>Truth</th><th>Marked by</th><th><span class="hidden-text">Change</span></th></tr></thead>
					<tbody>${value.groups.map((one) => html`<${GoldRow} key=${one.group} one=${one} change=${(/** @type {string} */ start) => told(patchGold(one.group, start))} drop=${() => told(deleteGold(one.group))} />`)}</tbody>
				</table></div>` : null}
		</section>
	`;
}
