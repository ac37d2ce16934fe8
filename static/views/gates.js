// @ts-check
/** The gate waterfall: value, threshold and margin of each gate, and what would make it pass. */

import { html } from 'htm/preact';

import { ballOf } from '../geometry/preview.js';
import { suggestions } from '../state/suggestions.js';
import { gatesOpen, pointTo } from '../state/workspace.js';
import { gateLabel, gateMargin, isUnjudged } from './gate_names.js';
import { carryOut } from './suggestion_actions.js';
import { uncertainViews } from './view_state.js';

/** @import {GateJson, GroupDocument, SolutionJson} from '../api/types.js' */
/** @import {Suggestion} from '../state/suggestions.js' */

/** More remedies than these nobody reads. */
const MOST = 4;

/** A pair such as A–B stays on one line. @param {string} sentence */
function unbroken(sentence) {
	return sentence.replaceAll('–', '\u2060–\u2060');
}

/** Gates that only count the views that those before them left over. */
const COUNTING = new Set(['two_views', 'ball']);

/** Whether a gate fails for no other reason than that views fell at one before it. @param {GroupDocument} group @param {GateJson} gate @param {GateJson[]} before */
function follows(group, gate, before) {
	if (!COUNTING.has(gate.name) || before.every(({ passed }) => passed)) return false;
	const counted = gate.name === 'ball' ? group.views.filter((view) => view.included && ballOf(view)) : group.views;
	return counted.length >= 2;
}

/** @param {GroupDocument} group @param {GateJson} gate @param {GateJson[]} before the gates above it @param {boolean} uncertain whether lines leave a camera open */
export function stateOf(group, gate, before, uncertain) {
	if (!gate.active) return { state: 'off', glyph: '·', word: 'not required' };
	if (isUnjudged(gate)) return { state: 'off', glyph: '·', word: 'not judged' };
	if (gate.passed && gate.name === 'calibratable' && uncertain) return { state: 'doubt', glyph: '!', word: 'passed, with a camera that is uncertain' };
	if (gate.passed) return { state: 'passed', glyph: '✓', word: 'passed' };
	if (follows(group, gate, before)) return { state: 'follows', glyph: '↳', word: 'fails because of the gate above' };
	return { state: 'failed', glyph: '✗', word: 'failed' };
}

/** @param {{group: GroupDocument, remedy: Suggestion}} props */
function RemedyRow({ group, remedy }) {
	return html`
		<li class="remedy" data-passes=${remedy.passes}>
			<button class="remedy__sentence" type="button" title="Show in the picture what this is about" onClick=${() => pointTo(group, { ...remedy, ball: Boolean(remedy.guide?.looks) })}>${remedy.sentence}</button>
			<button data-needs="annotate" class="button button--fix" type="button" onClick=${() => carryOut(remedy)}>${remedy.label}</button>
		</li>
	`;
}

/** What the solver has tried out, beside what the card on top offers. @param {{group: GroupDocument}} props */
function Remedies({ group }) {
	const tried = suggestions.value.filter(({ title }) => title === null).toSorted((a, b) => Number(b.passes) - Number(a.passes)).slice(0, MOST);
	if (tried.length === 0) return null;
	return html`
		<section class="remedies" aria-label="What would help">
			<h3>What would help</h3>
			<ul>${tried.map((remedy) => html`<${RemedyRow} key=${remedy.sentence} group=${group} remedy=${remedy} />`)}</ul>
		</section>
	`;
}

/** @param {{group: GroupDocument, solution: SolutionJson}} props */
export function Gates({ group, solution }) {
	const uncertain = uncertainViews(group, solution).length > 0;
	return html`
		<section class="card" aria-label="Gates">
			<h2>Gates · policy ${group.policy.name}
				<button class="card__more" type="button" aria-expanded=${gatesOpen.value} onClick=${() => { gatesOpen.value = !gatesOpen.value; }}>${gatesOpen.value ? 'less' : 'margins'}</button>
			</h2>
			<ol class="gates" data-open=${gatesOpen.value}>
				${solution.gates.map((gate, i) => {
					const { state, glyph, word } = stateOf(group, gate, solution.gates.slice(0, i), uncertain);
					const margin = gateMargin(gate);
					return html`
						<li key=${gate.name} data-state=${state} data-gate=${gate.name}>
							<span aria-hidden="true" title=${state === 'follows' || state === 'doubt' ? word : undefined}>${glyph}</span>
							<span class="gates__name term" tabindex="0" data-term=${`gate:${gate.name}`}>${gateLabel(gate, group.policy)}<span class="hidden-text">, ${word}:</span></span>
							<span class="gates__value" title=${margin}>${unbroken(gate.sentence)}</span>
							${gatesOpen.value && margin ? html`<span class="gates__margin">${margin}</span>` : null}
						</li>`;
				})}
			</ol>
			<${Remedies} group=${group} />
		</section>
	`;
}
