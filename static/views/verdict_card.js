// @ts-check
/** One sentence about the group: passes, or the first gate that fails. */

import { html } from 'htm/preact';

import { capital } from '../lib/format.js';
import { dismissTold } from '../state/dismissals.js';
import { mend, toldFinding } from '../state/mends.js';
import { REASONS } from '../state/reasons.js';
import { isBlind } from '../state/verdicts.js';
import { PitchLink } from './findings.js';
import { headline } from './verdict_text.js';
import { MendBox } from './mend_box.js';

/** @import {GroupDocument, SolutionJson, VerdictJson} from '../api/types.js' */

/** @param {VerdictJson} verdict */
function verdictText({ state, reason, note, by }) {
	const named = REASONS.find(({ name }) => name === reason);
	const why = named && named.name !== 'other' ? named.label.toLowerCase() : '';
	const who = by && by !== 'local' ? `by ${by}` : '';
	const said = note ? `“${note.replaceAll('\n', ' · ')}”` : '';
	return [state === 'unreviewed' ? 'Note' : capital(state), why, said, who].filter(Boolean).join(' · ');
}

/** @param {{group: GroupDocument, solution: SolutionJson | null, live: boolean}} props */
export function VerdictCard({ group, solution, live }) {
	const { tone, over, title, text } = headline(group, solution, mend.value);
	const sure = toldFinding.value?.confidence ?? null;
	const { verdict } = group;
	return html`
		<section class="card verdict-card" data-tone=${tone === 'ok' && isBlind(group) ? 'warn' : tone} data-live=${live} aria-label="Result">
			<p class="verdict-card__over">${over}</p>
			<h1>${title}</h1>
			<p class="verdict-card__text">${text}${sure === null ? '' : html` <span class="verdict-card__sure">${Math.round(sure * 100)} % sure.</span>`}</p>
			${solution?.findings.some(({ kind, sentence }) => kind === 'pitch_size' && sentence === text) ? html`<${PitchLink} dataset=${group.dataset.name} />` : null}
			<${MendBox} group=${group} solution=${solution} />
			${toldFinding.value ? html`<p class="verdict-card__checked"><button class="button button--small" type="button" data-needs="review" title="This finding was checked and is fine; Ctrl Z opens it again" onClick=${dismissTold}>Checked, fine <kbd>⇧S</kbd></button></p>` : null}
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
