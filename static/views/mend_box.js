// @ts-check
/** What would mend the group, each on one key; and the reason to reject it where nothing does. */

import { html } from 'htm/preact';

import { suggestedReason } from '../state/advice.js';
import { isSearching } from '../state/insight.js';
import { isMendTold, mend, mendIndex, mends, turnMend } from '../state/mends.js';
import { REASONS } from '../state/reasons.js';
import { askReason } from '../state/verdicts.js';
import { drawing } from '../state/workspace.js';
import { mendNow } from './mend_actions.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */

/** @param {{group: GroupDocument, solution: SolutionJson | null}} props */
export function MendBox({ group, solution }) {
	const offered = mend.value;
	const count = mends.value.length;
	const reason = group.verdict.state === 'rejected' ? undefined : REASONS.find(({ name }) => name === suggestedReason(solution));
	if (!offered && !reason) return null;
	if (drawing.value && drawing.value.what !== 'ask') {
		const { what, marking } = drawing.value;
		return html`
			<div class="mend" role="group" aria-label="What to do">
				<p class="mend__sentence">You are drawing ${what === 'ball' ? 'the ball' : html`“${marking}”`} in the picture. <kbd>Esc</kbd> ends it.</p>
			</div>`;
	}
	return html`
		<div class="mend" role="group" aria-label="What to do">
			${offered && !isMendTold.value ? html`<p class="mend__sentence">${offered.title ? `${offered.title}. ` : ''}${offered.finding ? '' : offered.sentence}</p>` : null}
			<p class="mend__row">
				${offered ? html`<button data-needs="annotate" class="button button--fix" type="button" onClick=${mendNow}>${offered.label} <kbd>Enter</kbd></button>` : null}
				${offered && count > 1 ? html`
					<button class="mend__more" type="button" title="Show another fix (Shift+Enter)" onClick=${() => turnMend(1)}>
						${mendIndex.value + 1} of ${count}${isSearching.value ? ' or more' : ''} <kbd>Shift Enter</kbd>
					</button>` : null}
			</p>
			${reason?.name === 'not_same_instant' ? html`
				<p class="mend__hint">To compare players and clock: <kbd>H</kbd> hides what is drawn on the pictures, <kbd>1</kbd> <kbd>1</kbd> and <kbd>2</kbd> show one alone, <kbd>0</kbd> all.</p>` : null}
			${reason ? html`
				<p class="mend__reject">
					${offered ? 'Not the cause? ' : 'Cannot be fixed here. '}
					<button data-needs="review" class="mend__more" type="button" onClick=${askReason}>Reject: ${reason.label.toLowerCase()} <kbd>X</kbd> <kbd>Enter</kbd></button>
				</p>` : null}
		</div>
	`;
}
