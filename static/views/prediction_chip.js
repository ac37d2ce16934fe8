// @ts-check
/** What is known of the selected prediction, or of the ball that was one, and how to accept it. */

import { html } from 'htm/preact';

import { scoreText } from '../lib/format.js';
import { acceptMark } from '../state/predictions.js';
import { selected } from '../state/workspace.js';

/** @import {ViewPicture} from '../overlays/scene.js' */

/** @param {{picture: ViewPicture}} props */
export function PredictionChip({ picture: { view, predictions } }) {
	const object = selected.value;
	if (object?.view !== view.key || !predictions) return null;
	if (object.kind === 'ball' && predictions.origin) {
		return html`<p class="drawing-chip prediction-chip" data-accepted="true"><span>Ball ${predictions.origin}</span></p>`;
	}
	const mark = object.kind === 'prediction' ? predictions.marks.find(({ id }) => id === object.prediction) : undefined;
	if (!mark) return null;
	const there = view.balls.length > 0;
	return html`
		<p class="drawing-chip prediction-chip">
			<span><strong>${mark.name}</strong> predicts a ball, ${mark.scored ? `score ${scoreText(mark)}` : scoreText(mark)}</span>
			<button class="drawing-chip__end" type="button" onClick=${() => acceptMark(view, mark, there)}>
				${there ? 'Replace the ball' : html`Accept <kbd>Y</kbd>`}
			</button>
		</p>
	`;
}
