// @ts-check
/** What was predicted in each view, and which of it a person accepts. */

import { html } from 'htm/preact';

import { withValue } from '../lib/field.js';
import { pixelText, plural, scoreText } from '../lib/format.js';
import { acceptEdits, distanceTo, EVERY_SET, surest } from '../state/prediction_marks.js';
import { acceptAll, acceptMark, leastScore, predicted, shownSet } from '../state/predictions.js';
import { focusView, selected } from '../state/workspace.js';
import { Letter } from './letter.js';

/** @import {GroupDocument, ViewJson} from '../api/types.js' */
/** @import {Mark, ViewMarks} from '../state/prediction_marks.js' */
/** @import {Predicted} from '../state/predictions.js' */

/** The sign that predictions have on the pictures. */
function Brackets() {
	return html`<svg class="predictions__sign" viewBox="0 0 12 12" aria-hidden="true"><path d="M1 4V1h3M8 1h3v3M11 8v3H8M4 11H1V8" /></svg>`;
}

/** @param {{predicted: Predicted}} props */
function Choice({ predicted: { sets, set } }) {
	return html`
		<div class="predictions__choice">
			${sets.length < 2 ? html`<span class="predictions__set" title=${sets[0]}>${sets[0]}</span>` : html`
				<select class="field" aria-label="Set of predictions" value=${set || EVERY_SET} onChange=${withValue((chosen) => { shownSet.value = chosen; })}>
					<option value=${EVERY_SET}>All ${sets.length} sets</option>
					${sets.map((name) => html`<option key=${name} value=${name}>${name}</option>`)}
				</select>`}
			<label class="predictions__least" title="Predictions with a score below this threshold are dotted and accepted one by one">
				threshold
				<input
					class="field" type="number" min="0" max="1" step="0.05" value=${leastScore.value}
					onChange=${withValue((text) => { leastScore.value = Math.min(1, Math.max(0, Number(text) || 0)); })}
				/>
			</label>
		</div>
	`;
}

/** @param {{view: ViewJson, mark: Mark, sets: number}} props */
function Offered({ view, mark, sets }) {
	const away = distanceTo(view, mark);
	const there = view.balls.length > 0;
	const what = away === null ? '' : ` · ${pixelText(away)} off`;
	return html`
		<span class="predictions__what" title=${`${mark.name}, ${mark.scored ? 'score ' : ''}${scoreText(mark)}`}>
			${sets > 1 ? `${mark.name} ` : ''}${scoreText(mark)}${what}
		</span>
		<button
			class="button button--small" type="button"
			title=${there ? 'Replace the annotated ball by the prediction' : 'Make it the ball of this view (Y)'}
			aria-label=${`${there ? 'Replace the ball of' : 'Accept the prediction in'} ${view.letter}${there ? ' by the prediction' : ''}`}
			onClick=${() => acceptMark(view, mark, there)}
		>${there ? 'Replace' : 'Accept'}</button>
	`;
}

/** @param {{view: ViewJson, own: ViewMarks, sets: number}} props */
function Row({ view, own: { marks, fewer, origin }, sets }) {
	const mark = surest(marks);
	const others = marks.length + fewer - (mark ? 1 : 0);
	function show() {
		focusView(view.letter);
		if (mark) selected.value = { kind: 'prediction', view: view.key, prediction: mark.id };
	}
	return html`
		<li data-prediction=${view.letter}>
			<button class="row-button" type="button" title=${`Show ${view.label}`} aria-label=${`Show the prediction in view ${view.letter}`} onClick=${show}><${Letter} letter=${view.letter} /></button>
			${origin ? html`<span class="predictions__accepted">${origin}</span>`
				: mark ? html`<${Offered} view=${view} mark=${mark} sets=${sets} />`
					: html`<span class="predictions__none">${others ? `: ${others} below threshold` : 'nothing predicted'}</span>`}
		</li>
	`;
}

/** @param {{group: GroupDocument}} props */
export function PredictionCard({ group }) {
	const found = predicted.value;
	if (!found) return null;
	const ready = acceptEdits(group, found.views).length;
	const why = ready ? '' : 'Every view with a prediction above the threshold has a ball already';
	return html`
		<section class="card predictions" aria-label="Predictions">
			<h2 title="Corner brackets: predicted, dotted below the threshold. Solid box: drawn by a person. Dashed box: fits the 3D ball."><${Brackets} /> Predictions</h2>
			${found.sets.length ? html`<${Choice} predicted=${found} />` : null}
			<ul class="predictions__views">
				${group.views.map((view) => html`<${Row} key=${view.key} view=${view} own=${found.views.get(view.key) ?? { marks: [], fewer: 0, origin: null }} sets=${found.set === '' ? found.sets.length : 1} />`)}
			</ul>
			<button data-needs="annotate" class="button predictions__all" type="button" aria-disabled=${why !== ''} title=${why || 'Each is an edit that undo takes back (Shift+Y)'} onClick=${() => { if (!why) acceptAll(); }}>
				${ready ? `Accept in ${plural(ready, 'view')} without a ball` : 'Nothing more to accept'}
			</button>
		</section>
	`;
}
