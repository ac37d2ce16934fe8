// @ts-check
/** The gate waterfall: value, threshold and margin of each gate, in the order they are judged. */

import { html } from 'htm/preact';

import { gateLabel, gateMargin } from './gate_names.js';

/** @import {GateJson, GroupDocument, SolutionJson} from '../api/types.js' */

/** A pair such as A–B stays on one line. @param {string} sentence */
function unbroken(sentence) {
	return sentence.replaceAll('–', '\u2060–\u2060');
}

/** @param {GateJson} gate */
function stateOf(gate) {
	if (!gate.active) return { state: 'off', glyph: '·', word: 'not asked' };
	if (gate.passed) return { state: 'passed', glyph: '✓', word: 'passed' };
	return { state: 'failed', glyph: '✗', word: 'failed' };
}

/** @param {{group: GroupDocument, solution: SolutionJson}} props */
export function Gates({ group, solution }) {
	return html`
		<section class="card" aria-label="Gates">
			<h2>Gates · policy ${group.policy.name}</h2>
			<ol class="gates">
				${solution.gates.map((gate) => {
					const { state, glyph, word } = stateOf(gate);
					return html`
						<li key=${gate.name} data-state=${state} data-gate=${gate.name}>
							<span aria-hidden="true">${glyph}</span>
							<span class="gates__name">${gateLabel(gate, group.policy)}<span class="hidden-text">, ${word}:</span></span>
							<span class="gates__value" title=${gateMargin(gate)}>${unbroken(gate.sentence)}</span>
						</li>`;
				})}
			</ol>
		</section>
	`;
}
