// @ts-check
/** Two runs side by side: every number, and the frames that differ most. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { getComparison } from '../../api/evaluations.js';
import { sentenceOf } from '../../api/problem.js';
import { withValue } from '../../lib/field.js';
import { count, plural, words } from '../../lib/format.js';
import { matchName } from '../../lib/match_name.js';
import { useResource } from '../../lib/resource.js';
import { reviewAddress } from '../../state/navigation.js';
import { Loading } from '../page_frame.js';
import { Cell, number } from './cell.js';

/** @import {ComparisonJson, EvaluationJson} from '../../api/evaluations.js' */

const FIELDS = [
	{ name: 'error_m', label: 'error of the ball position, m' }, { name: 'iou', label: 'IoU of the box with the highest score' }, { name: 'hit_iou', label: 'IoU of the box that counts as found' },
	{ name: 'predicted_error_m', label: 'error with predicted cameras, m' }, { name: 'predicted_jac', label: 'JaC of predicted cameras' },
];

/** @param {number | null} value */
const signed = (value) => (value === null ? '–' : `${value > 0 ? '+' : ''}${number(value)}`);

/** @param {number | null} change @param {string} better `higher`, `lower` or empty @returns {{grade?: string, word: string}} */
function judged(change, better) {
	if (!change || !better) return { word: '' };
	return (change > 0) === (better === 'higher') ? { grade: 'ok', word: 'better' } : { grade: 'warn', word: 'worse' };
}

/** @param {{one: ComparisonJson['numbers'][number]}} props */
function NumberRow({ one }) {
	const { grade, word } = judged(one.change, one.better);
	return html`
		<tr>
			<th scope="row">${one.label}${one.unit ? `, ${one.unit}` : ''}<small>${words(one.table)} · ${words(one.row)}</small></th>
			<td data-numeric="true"><${Cell} cell=${one.first} /></td><td data-numeric="true"><${Cell} cell=${one.second} /></td>
			<td data-numeric="true" data-grade=${grade}>${signed(one.change)}<small>${word}</small></td>
		</tr>
	`;
}

/** @param {{found: ComparisonJson}} props */
function Numbers({ found }) {
	const [all, showAll] = useState(false);
	const moved = found.numbers.filter(({ change }) => change !== 0);
	const still = found.numbers.length - moved.length;
	return html`
		<div class="table__scroll" tabindex="0" role="region" aria-label="Numbers of both runs">
			<table class="table">
				<thead><tr><th>number</th><th data-numeric="true">${found.first.name}</th><th data-numeric="true">${found.second.name}</th><th data-numeric="true">change</th></tr></thead>
				<tbody>${(all ? found.numbers : moved).map((one) => html`<${NumberRow} key=${`${one.table} ${one.row} ${one.column}`} one=${one} />`)}</tbody>
			</table>
		</div>
		${still && !all ? html`<p class="yield__note">${plural(still, 'number')} did not change. <button class="link-button" type="button" onClick=${() => showAll(true)}>Show ${still === 1 ? 'it' : 'them'}</button></p>` : null}
	`;
}

/** @param {{found: ComparisonJson}} props */
function Frames({ found }) {
	const { field } = found;
	return html`
		<p class="yield__note">${plural(found.shared, 'frame')} in both: ${count(found.better)} better, ${count(found.worse)} worse, ${count(found.gained)} gained, ${count(found.lost)} lost; mean change ${signed(found.mean_change)}.</p>
		<table class="table">
			<thead><tr><th>group and view</th><th data-numeric="true">${found.first.name}</th><th data-numeric="true">${found.second.name}</th><th data-numeric="true">change</th></tr></thead>
			<tbody>${found.frames.map(({ first, second, change }) => {
				const { name, aside } = matchName(second.group);
				return html`
					<tr key=${second.frame_id}>
						<th scope="row">${second.group_id > 0 ? html`<a href=${reviewAddress(second.group_id, '')}>${name}</a>` : name}<small>${[`view ${second.view}`, aside].filter(Boolean).join(' · ')}</small></th>
						<td data-numeric="true">${first[field] === null ? '–' : number(first[field])}</td><td data-numeric="true">${second[field] === null ? '–' : number(second[field])}</td><td data-numeric="true">${signed(change)}</td>
					</tr>`;
			})}
			</tbody>
		</table>
	`;
}

/** @param {{run: EvaluationJson, other: number, onClose: () => void}} props */
export function Comparison({ run, other, onClose }) {
	const [field, setField] = useState(FIELDS[0].name);
	const found = useResource((signal) => getComparison(run.id, other, field, signal), [run.id, other, field]);
	return html`
		<section class="card card--flush" aria-labelledby="comparison-title">
			<h2 id="comparison-title">Compared with ${found.value?.first.name ?? '…'} <button class="card__aside link-button" type="button" onClick=${onClose}>Close<span class="hidden-text"> the comparison</span></button></h2>
			${found.error ? html`<p class="form__error" role="alert">${sentenceOf(found.error)}</p>` : null}
			${!found.value && !found.error ? html`<${Loading} what="the comparison" />` : null}
			${found.value && !found.value.same_truth ? html`<p class="yield__note" data-grade="warn">The runs judged other frames, or under other thresholds: their numbers are not directly comparable.</p>` : null}
			${found.value?.differs.length ? html`<p class="note">The runs differ in: ${found.value.differs.map(words).join(', ')}.</p>` : null}
			${found.value ? html`
				<${Numbers} found=${found.value} />
				<div class="form__row comparison__field"><label for="comparison-field">Frame by frame</label>
					<select class="field" id="comparison-field" value=${field} onChange=${withValue(setField)}>
						${FIELDS.map(({ name, label }) => html`<option key=${name} value=${name}>${label}</option>`)}
					</select></div>
				<${Frames} found=${found.value} />` : null}
		</section>
	`;
}
