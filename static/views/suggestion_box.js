// @ts-check
/** What would correct the group, each on one key; and the reason to reject it where nothing does. */

import { html } from 'htm/preact';

import { suggestedReason } from '../state/advice.js';
import { isSearching } from '../state/insight.js';
import { isSuggestionShown, suggestion, suggestionIndex, suggestions, nextSuggestion } from '../state/suggestions.js';
import { REASONS } from '../state/reasons.js';
import { askReason } from '../state/verdicts.js';
import { drawing } from '../state/workspace.js';
import { applySuggestion } from './suggestion_actions.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */

/** @param {{group: GroupDocument, solution: SolutionJson | null}} props */
export function SuggestionBox({ group, solution }) {
	const offered = suggestion.value;
	const count = suggestions.value.length;
	const reason = group.verdict.state === 'rejected' ? undefined : REASONS.find(({ name }) => name === suggestedReason(solution));
	if (!offered && !reason) return null;
	if (drawing.value && drawing.value.what !== 'ask') {
		const { what, marking } = drawing.value;
		return html`
			<div class="suggestion" role="group" aria-label="What to do">
				<p class="suggestion__sentence">You are drawing ${what === 'ball' ? 'the ball' : html`“${marking}”`} in the picture. <kbd>Esc</kbd> ends it.</p>
			</div>`;
	}
	return html`
		<div class="suggestion" role="group" aria-label="What to do">
			${offered && !isSuggestionShown.value ? html`<p class="suggestion__sentence">${offered.title ? `${offered.title}. ` : ''}${offered.finding ? '' : offered.sentence}</p>` : null}
			<p class="suggestion__row">
				${offered ? html`<button data-needs="annotate" class="button button--fix" type="button" onClick=${applySuggestion}>${offered.label} <kbd>Enter</kbd></button>` : null}
				${offered && count > 1 ? html`
					<button class="suggestion__more" type="button" title="Show another fix (Shift+Enter)" onClick=${() => nextSuggestion(1)}>
						${suggestionIndex.value + 1} of ${count}${isSearching.value ? ' or more' : ''} <kbd>Shift Enter</kbd>
					</button>` : null}
			</p>
			${reason?.name === 'not_same_instant' ? html`
				<p class="suggestion__hint">To compare players and clock: <kbd>H</kbd> hides the overlays, <kbd>1</kbd> <kbd>1</kbd> shows view A alone, <kbd>2</kbd> view B, <kbd>0</kbd> all views.</p>` : null}
			${reason ? html`
				<p class="suggestion__reject">
					${offered ? 'If the fix is wrong: ' : 'No fix is known. '}
					<button data-needs="review" class="suggestion__more" type="button" onClick=${askReason}>Reject: ${reason.label.toLowerCase()} <kbd>X</kbd> <kbd>Enter</kbd></button>
				</p>` : null}
		</div>
	`;
}
