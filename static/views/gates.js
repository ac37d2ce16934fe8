// @ts-check
/** The gate waterfall: value, threshold and margin of each gate, and what would make it pass. */

import { html } from 'htm/preact';

import { editOfFix } from '../state/edits.js';
import { submit } from '../state/group.js';
import { remedies } from '../state/insight.js';
import { focusView, gatesOpen, selected } from '../state/workspace.js';
import { gateLabel, gateMargin } from './gate_names.js';

/** @import {FixJson, GateJson, GroupDocument, SolutionJson} from '../api/types.js' */
/** @import {Remedy} from '../state/insight.js' */

/** More remedies than these nobody reads. */
const MOST = 4;

/** A pair such as A–B stays on one line. @param {string} sentence */
function unbroken(sentence) {
	return sentence.replaceAll('–', '\u2060–\u2060');
}

/** @param {GateJson} gate */
function stateOf(gate) {
	if (!gate.active) return { state: 'off', glyph: '·', word: 'not asked' };
	if (gate.value === null) return { state: 'off', glyph: '·', word: 'not judged' };
	if (gate.passed) return { state: 'passed', glyph: '✓', word: 'passed' };
	return { state: 'failed', glyph: '✗', word: 'failed' };
}

/** @param {FixJson} edit */
function applyLabel({ action }) {
	if (action === 'move_point' || action === 'move_ball') return 'Move it';
	if (action === 'swap_sides') return 'Swap sides';
	if (action === 'drop_point' || action === 'drop_marking') return 'Drop it';
	return action === 'relabel' ? 'Relabel' : 'Leave out';
}

/** Show what a remedy speaks about. @param {GroupDocument} group @param {FixJson} edit */
function show(group, edit) {
	const view = group.views.find(({ key }) => key === edit.view);
	if (!view) return;
	focusView(view.letter);
	if (edit.action === 'move_ball') selected.value = { kind: 'ball', view: view.key };
	else if (edit.marking && view.lines[edit.marking]) {
		selected.value = { kind: 'point', view: view.key, marking: edit.marking, index: edit.index ?? 0 };
	}
}

/** @param {{group: GroupDocument, remedy: Remedy}} props */
function RemedyRow({ group, remedy }) {
	const edit = editOfFix(group, remedy.edit);
	if (!edit) return null;
	return html`
		<li class="remedy" data-passes=${remedy.passes}>
			<button class="remedy__sentence" type="button" title="Show what this is about" onClick=${() => show(group, remedy.edit)}>${remedy.sentence}</button>
			<button class="button button--fix" type="button" onClick=${() => submit(edit)}>${applyLabel(remedy.edit)}</button>
		</li>
	`;
}

/** @param {{group: GroupDocument}} props */
function Remedies({ group }) {
	const known = remedies.value;
	if (!known?.key.startsWith(`remedies ${group.id} `)) return null;
	const possible = known.items.filter((remedy) => editOfFix(group, remedy.edit));
	if (possible.length === 0) return null;
	const best = possible.toSorted((a, b) => Number(b.passes) - Number(a.passes)).slice(0, MOST);
	return html`
		<section class="remedies" aria-label="What would help">
			<h3>${best[0].passes ? 'Would pass if' : 'Would come closer if'}</h3>
			<ul>${best.map((remedy) => html`<${RemedyRow} key=${remedy.sentence} group=${group} remedy=${remedy} />`)}</ul>
		</section>
	`;
}

/** @param {{group: GroupDocument, solution: SolutionJson}} props */
export function Gates({ group, solution }) {
	return html`
		<section class="card" aria-label="Gates">
			<h2>Gates · policy ${group.policy.name}
				<button class="card__more" type="button" aria-expanded=${gatesOpen.value} onClick=${() => { gatesOpen.value = !gatesOpen.value; }}>${gatesOpen.value ? 'less' : 'margins'}</button>
			</h2>
			<ol class="gates" data-open=${gatesOpen.value}>
				${solution.gates.map((gate) => {
					const { state, glyph, word } = stateOf(gate);
					const margin = gateMargin(gate);
					return html`
						<li key=${gate.name} data-state=${state} data-gate=${gate.name}>
							<span aria-hidden="true">${glyph}</span>
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
