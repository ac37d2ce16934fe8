// @ts-check
/** What a panel shows, in words: letter, name, state, JaC, ball error. */

import { html } from 'htm/preact';

import { GLYPHS } from '../geometry/residual.js';
import { pixelText } from '../lib/format.js';
import { overlaysHidden } from '../state/workspace.js';
import { otherShape } from './frame.js';
import { errorOf, gradeOfView, jacOf } from './view_state.js';
import { Letter } from './letter.js';

/** @import {ViewPicture} from '../overlays/scene.js' */

/** What an error is measured from, where there is little room. */
const SHORT = { ball: '', pair: ' (best pair)', others: ' (from others)' };

/** @param {{picture: ViewPicture, frame?: ImageBitmap | null}} props */
export function PanelCaption({ picture, frame }) {
	const { view, solved } = picture;
	const error = errorOf(picture);
	const { grade, sentence } = gradeOfView(picture);
	// Of a view that is left out nothing counts but why.
	const jac = view.included ? jacOf(solved) : null;
	const shape = otherShape(frame, view);
	// With the overlays goes what may stand on a clock that is burnt into the picture.
	if (overlaysHidden.value) return html`<figcaption class="caption caption--bare"><${Letter} letter=${view.letter} /></figcaption>`;
	return html`
		<figcaption class="caption">
			<${Letter} letter=${view.letter} />
			<span class="caption__name">${view.label}</span>
			<span class="caption__state" data-grade=${grade}>
				<span aria-hidden="true">${GLYPHS[grade]}</span> ${sentence}
				${jac !== null ? html`<span data-number="jac">${sentence ? ' · ' : ''}JaC ${jac.toFixed(2)}</span>` : null}
				${error.px === null ? null : html`<span data-number="error"> · ball ${pixelText(error.px)}${SHORT[error.from]}</span>`}
			</span>
			${shape ? html`<span class="caption__state" data-grade="warn" title=${shape}>! other aspect ratio</span>` : null}
		</figcaption>
	`;
}
