// @ts-check
/** What a person should look at beside what the card on top says, each with its fix. */

import { html } from 'htm/preact';

import { address } from '../lib/router.js';
import { findingTitle } from '../state/advice.js';
import { dismiss } from '../state/dismissals.js';
import { suggestions, shownFinding } from '../state/suggestions.js';
import { openFindings } from '../state/open_findings.js';
import { groupTrack } from '../state/group_track.js';
import { pointTo } from '../state/workspace.js';
import { Letter } from './letter.js';
import { pageAddress } from './dataset_menu.js';
import { When } from './when.js';
import { carryOut } from './suggestion_actions.js';

/** @import {FindingJson, GroupDocument, SolutionJson} from '../api/types.js' */

/** @param {{group: GroupDocument, finding: FindingJson}} props */
function Finding({ group, finding }) {
	const view = group.views.find((candidate) => candidate.key === finding.view);
	const sure = finding.confidence === null ? '' : ` (${Math.round(finding.confidence * 100)} % sure)`;
	const title = findingTitle(group, finding);
	const offered = suggestions.value.filter((suggestion) => suggestion.sentence === finding.sentence && suggestion.view === finding.view);
	const checked = finding.dismissed;
	return html`
		<li class="finding" data-kind=${finding.kind} data-dismissed=${Boolean(checked)}>
			<p>
				${view ? html`<button class="row-button" type="button" aria-label=${`Focus view ${view.letter}`} onClick=${() => pointTo(group, { ...finding, index: finding.fix?.index ?? null })}><${Letter} letter=${view.letter} /></button>` : null}
				${checked ? html`<s><strong>${title}${sure}.</strong> ${finding.sentence}</s>` : html`<strong>${title}${sure}.</strong> ${finding.sentence}`}
			</p>
			${checked ? html`<p class="finding__checked">Dismissed${checked.by === 'local' ? '' : ` by ${checked.by}`}, <${When} at=${checked.at} />${checked.note ? ` · “${checked.note}”` : ''}</p>` : null}
			<${FindingLink} finding=${finding} dataset=${group.dataset.name} />
			${html`
				<p class="finding__fixes">
					<button type="button" data-needs="review" class="button button--small" title=${checked ? 'Make this finding flag the group again' : 'You checked this finding and it is fine: it no longer flags the group'} onClick=${() => dismiss(finding, !checked)}>${checked ? 'Reopen' : 'Dismiss'}<span class="hidden-text"> ${title}</span></button>
					${offered.map((suggestion) => html`<button type="button" data-needs="annotate" class="button button--fix" onClick=${() => carryOut(suggestion)}>${suggestion.label}</button>`)}
				</p>`}
		</li>
	`;
}

/** Where something is seen whole that a finding says of a match or a track. @param {{finding: FindingJson | undefined, dataset: string}} props */
export function FindingLink({ finding, dataset }) {
	if (finding?.kind === 'pitch_size') return html`<p><a class="link" href=${pageAddress(dataset, 'statistics')}>See pitch sizes on the Statistics page</a></p>`;
	const at = finding?.kind === 'track_disagrees' ? groupTrack.value : null;
	if (!at) return null;
	return html`<p><a class="link" href=${address(`/tracks/${at.track.id}`, { frame: String(at.frame) })}>Its track at frame ${at.frame}</a>${at.track.stale ? ' (stale: groups have changed since it was made)' : ''}</p>`;
}

/** @param {{group: GroupDocument, solution: SolutionJson}} props */
export function Findings({ group, solution }) {
	const findings = solution.findings.filter((finding) => finding !== shownFinding.value);
	if (findings.length === 0) return null;
	const more = shownFinding.value !== null;
	const open = openFindings({ ...solution, findings }).length;
	return html`
		<section class="card" aria-label="Findings">
			<h2>${more ? 'More findings' : 'Findings'} · ${open}${open < findings.length ? ` open, ${findings.length - open} dismissed` : ''}</h2>
			<ul class="findings">
				${findings.map((finding, i) => html`<${Finding} key=${i} group=${group} finding=${finding} />`)}
			</ul>
		</section>
	`;
}
