// @ts-check
/** One sentence about the group: passes, or the first gate that fails. */

import { html } from 'htm/preact';

import { capital } from '../lib/format.js';
import { dismissShown } from '../state/dismissals.js';
import { suggestion, shownFinding } from '../state/suggestions.js';
import { REASONS } from '../state/reasons.js';
import { isBlind } from '../state/verdicts.js';
import { pointTo } from '../state/workspace.js';
import { FindingLink } from './findings.js';
import { headline } from './verdict_text.js';
import { SuggestionBox } from './suggestion_box.js';

/** @import {GroupDocument, SolutionJson, VerdictJson} from '../api/types.js' */
/** @import {Remark} from './verdict_text.js' */

/** @param {VerdictJson} verdict */
function verdictText({ state, reason, note, by }) {
	const named = REASONS.find(({ name }) => name === reason);
	const why = named && named.name !== 'other' ? named.label.toLowerCase() : '';
	const who = by && by !== 'local' ? `by ${by}` : '';
	const said = note ? `“${note.replaceAll('\n', ' · ')}”` : '';
	return [state === 'unreviewed' ? 'Note' : capital(state), why, said, who].filter(Boolean).join(' · ');
}

/** Leads to the lines of the view that a remark is about, and to the worst point of its marking. @param {{group: GroupDocument, solution: SolutionJson | null, remark: Remark}} props */
function RemarkLink({ group, solution, remark: { view, letter, marking } }) {
	function lead() {
		const fit = solution?.views.find((one) => one.view === view)?.calibration.markings.find((one) => one.marking === marking);
		const far = fit?.distances_px ?? [];
		pointTo(group, { view, marking, index: Math.max(0, far.indexOf(Math.max(...far))) });
		// The card of the view is there with the next frame.
		requestAnimationFrame(() => document.querySelector(`[aria-label="Lines of view ${letter}"]`)?.scrollIntoView({ block: 'nearest' }));
	}
	return html`<button class="link-button" type="button" title=${`Show the lines of view ${letter}`} onClick=${lead}>${marking ? `“${marking}” of ${letter}` : `View ${letter}`}</button>`;
}

/** @param {{group: GroupDocument, solution: SolutionJson | null, live: boolean}} props */
export function VerdictCard({ group, solution, live }) {
	const { tone, over, title, text, remarks = [] } = headline(group, solution, suggestion.value);
	const sure = shownFinding.value?.confidence ?? null;
	const { verdict } = group;
	return html`
		<section class="card verdict-card" data-tone=${tone === 'ok' && isBlind(group) ? 'warn' : tone} data-live=${live} aria-label="Result">
			<p class="verdict-card__over">${over}</p>
			<h1>${title}</h1>
			<p class="verdict-card__text">${text}${sure === null ? '' : html` <span class="verdict-card__sure">${Math.round(sure * 100)} % sure.</span>`}</p>
			${remarks.map((remark) => html`<p class="verdict-card__text" data-remark=${remark.letter}><${RemarkLink} group=${group} solution=${solution} remark=${remark} />${' '}${remark.text}</p>`)}
			<${FindingLink} finding=${solution?.findings.find(({ sentence }) => sentence === text)} dataset=${group.dataset.name} />
			<${SuggestionBox} group=${group} solution=${solution} />
			${shownFinding.value ? html`<p class="verdict-card__checked"><button class="button button--small" type="button" data-needs="review" title="You checked this finding and it is fine; Ctrl Z reopens it" onClick=${dismissShown}>Dismiss finding <kbd>⇧S</kbd></button></p>` : null}
			${isBlind(group) ? html`<p><span class="pill" data-status="no-picture">no picture</span> <span data-grade="warn">No view of this group has a picture to look at.</span></p>` : null}
			${verdict.state === 'unreviewed' && !verdict.note ? null : html`
				<p class="verdict-card__verdict">
					<span class="pill" data-status=${verdict.state}>${verdictText(verdict)}</span>
					${verdict.stale ? html`<span class="pill" data-status="stale">stale: changed since</span>` : null}
					${verdict.fixed && solution?.passes !== false ? html`<span class="pill" title="Edited, and accepted as it is now">fixed</span>` : null}
				</p>`}
		</section>
	`;
}
