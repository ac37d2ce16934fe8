// @ts-check
/** The table of before and after, before anything is saved. */

import { html } from 'htm/preact';

import { changed, isCurrent, refusal } from '../../state/calibration.js';
import { comparedRows, summaryOf } from './comparison_rows.js';

/** @import {GroupDocument, SolutionJson} from '../../api/types.js' */

const GLYPHS = { better: '▲', worse: '▼', other: '•', same: '' };
const WORDS = { better: 'better', worse: 'worse', other: 'changed', same: '' };

/** @param {{group: GroupDocument, view: string, before: SolutionJson | null, after: SolutionJson | null}} props */
export function Comparison({ group, view, before, after }) {
	const { text, grade } = summaryOf(group, view, after);
	const staged = changed.value;
	const asking = staged && !isCurrent.value && !refusal.value;
	const state = isCurrent.value ? 'not saved' : asking ? 'asking…' : 'not known';
	return html`
		<section class="card strip-card" aria-label="Before and after" aria-busy=${asking}>
			<h2>Before → after<span class="card__aside">${staged ? state : 'nothing staged'}</span></h2>
			<div class="editor__scroll" tabindex="0" role="group" aria-label="Before and after in numbers">
				<p class="comparison__summary" data-grade=${refusal.value ? 'bad' : grade} role="status">${refusal.value || text}</p>
				<table class="numbers comparison" data-live=${staged && !isCurrent.value}>
					<thead><tr><th scope="col"><span class="hidden-text">number</span></th><th scope="col">saved</th><th scope="col">staged</th><th scope="col"><span class="hidden-text">change</span></th></tr></thead>
					<tbody>
						${comparedRows(view, before, after).map(({ name, label, before: old, after: next, change }) => html`
							<tr key=${name} data-compared=${name} data-change=${change}>
								<th scope="row">${label}</th><td>${old}</td><td>${staged ? next : ''}</td>
								<td><span aria-hidden="true">${GLYPHS[change]}</span><span class="hidden-text">${WORDS[change]}</span></td>
							</tr>`)}
					</tbody>
				</table>
			</div>
		</section>
	`;
}
