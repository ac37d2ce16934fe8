// @ts-check
/** The markings of the focused view: how far each is off, and how much it matters. */

import { html } from 'htm/preact';

import { pixels } from '../lib/format.js';
import { markNotVisible } from '../state/edits.js';
import { submit } from '../state/group.js';
import { influence } from '../state/insight.js';
import { focused, selected } from '../state/workspace.js';
import { Letter } from './letter.js';
import { Term } from './term.js';
import { jacOf } from './view_state.js';

/** @import {GroupDocument} from '../api/types.js' */
/** @import {MarkingResiduals} from '../geometry/residual.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */
/** @import {Influence} from '../state/insight.js' */

/** Bars reach their end at twice what JaC allows. */
const FULL = 2;

/**
 * How far a marking would be off if the camera did not know it, and whether the view would be no
 * worse for that: a marking that fits costs JaC its share when it goes.
 *
 * @param {Influence | undefined} one
 */
function leftOut(one) {
	if (!one) return { text: '', better: false };
	if (!one.jac_without) return { text: 'needed', better: false };
	const better = one.jac_without['0.5'] >= one.jac['0.5'] && one.jac['0.5'] < 1;
	return { text: one.largest_px_without === null ? '–' : pixels(one.largest_px_without), better };
}

/** @param {Influence | undefined} one */
function leftOutWords(one) {
	if (!one) return '';
	if (!one.jac_without) return 'Without this marking, the view has no camera';
	return `Without it: JaC ${one.jac_without['0.5'].toFixed(2)} instead of ${one.jac['0.5'].toFixed(2)}`;
}

/** @param {{picture: ViewPicture, marking: MarkingResiduals, one: Influence | undefined}} props */
function LineRow({ picture, marking, one }) {
	const share = Math.min(1, (marking.largest ?? 0) / (FULL * picture.gamma));
	const index = marking.points.findIndex(({ distance }) => distance === marking.largest);
	const without = leftOut(one);
	const select = () => {
		selected.value = { kind: 'point', view: picture.view.key, marking: marking.marking, index: Math.max(0, index) };
	};
	return html`
		<li>
			<button class="view-line" type="button" onClick=${select} title=${`Select the worst point of ${marking.marking}`}>
				<span class="view-line__name">${marking.marking}</span>
				<svg class="view-line__bar" viewBox="0 0 100 8" preserveAspectRatio="none" data-grade=${marking.grade} aria-hidden="true">
					<rect class="view-line__track" width="100" height="8" /><rect class="view-line__fill" width=${100 * share} height="8" /><path d="M50 0V8" />
				</svg>
				<span data-grade=${marking.grade}>${marking.largest === null ? '–' : pixels(marking.largest)}</span>
				<span class="view-line__without" data-better=${without.better} title=${leftOutWords(one)}>${without.text}</span>
			</button>
		</li>
	`;
}

/** Markings that the picture would show and nobody has drawn, and those that it is said not to show. @param {{picture: ViewPicture}} props */
export function Undrawn({ picture: { view, markings } }) {
	const missing = markings.filter(({ points }) => points.length === 0);
	const hidden = view.not_visible ?? [];
	return html`
		${missing.length ? html`
			<p class="view-lines__missing">${missing.length} visible, not drawn:</p>
			<ul class="view-lines__undrawn">${missing.map(({ marking }) => html`
				<li key=${marking}>${marking} <button class="suggestion__more" type="button" data-needs="annotate" title="The marking is hidden or worn away: JaC then does not count it as missing" aria-label=${`${marking} is not visible`} onClick=${() => submit(markNotVisible(view, marking, true))}>not visible</button></li>`)}
			</ul>` : null}
		${hidden.length ? html`
			<p class="view-lines__missing">Marked as not visible:</p>
			<ul class="view-lines__undrawn">${hidden.map((marking) => html`
				<li key=${marking}>${marking} <button class="suggestion__more" type="button" data-needs="annotate" aria-label=${`${marking} is visible`} onClick=${() => submit(markNotVisible(view, marking, false))}>is visible</button></li>`)}
			</ul>` : null}
	`;
}

/** @param {{group: GroupDocument, pictures: ViewPicture[]}} props */
export function ViewLines({ group, pictures }) {
	const picture = pictures.find(({ view }) => view.letter === focused.value);
	if (!picture) return null;
	const drawn = picture.markings.filter(({ points }) => points.length > 0);
	const known = influence.value?.id === picture.view.id ? influence.value.items : [];
	const jac = jacOf(picture.solved);
	return html`
		<section class="card" aria-label=${`Lines of view ${picture.view.letter}`}>
			<h2><${Letter} letter=${picture.view.letter} /> Lines${jac === null ? '' : ` · JaC ${jac.toFixed(2)}`}
				<span class="card__aside"><${Term} word="column:line_error">px<//>${known.length ? html` · <${Term} word="column:line_without">px without it<//>` : null}</span></h2>
			${drawn.length ? html`
				<ul class="view-lines" data-influence=${known.length > 0}>
					${drawn.map((marking) => html`
						<${LineRow}
							key=${`${group.id} ${marking.marking}`} picture=${picture} marking=${marking}
							one=${known.find((one) => one.marking === marking.marking)}
						/>`)}
				</ul>` : html`<p class="empty-note">No lines are drawn in this view. N draws one.</p>`}
			<${Undrawn} picture=${picture} />
		</section>
	`;
}
