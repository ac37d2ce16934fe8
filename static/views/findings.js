// @ts-check
/** What a person should look at, each with its fix. */

import { html } from 'htm/preact';

import { ballOf } from '../geometry/preview.js';
import { capital, words } from '../lib/format.js';
import { editOfFix } from '../state/edits.js';
import { submit } from '../state/group.js';
import { focusView } from '../state/workspace.js';
import { Letter } from './letter.js';

/** @import {FindingJson, FixJson, GroupDocument, SolutionJson} from '../api/types.js' */

/** @param {FixJson} fix */
function fixLabel(fix) {
	if (fix.action === 'relabel') return `Relabel as ${fix.to}`;
	if (fix.action === 'drop_point') return `Drop point ${(fix.index ?? 0) + 1}`;
	if (fix.action === 'drop_marking') return 'Drop this marking';
	if (fix.action === 'swap_sides') return 'Swap sides';
	if (fix.action === 'exclude_view') return 'Leave this view out';
	return capital(words(fix.action));
}

/**
 * The buttons of a finding: one, or one for each ball to pick from.
 *
 * @param {GroupDocument} group @param {FixJson} fix
 * @returns {{label: string, fix: FixJson}[]}
 */
function choices(group, fix) {
	const view = group.views.find((candidate) => candidate.key === fix.view);
	if (fix.action !== 'pick_ball' || !view || ballOf(view)) return [{ label: fixLabel(fix), fix }];
	return view.balls.flatMap((ball, index) => (
		ball.out_of_view ? [] : [{ label: `Keep ball ${index + 1}`, fix: { ...fix, index } }]
	));
}

/** @param {{group: GroupDocument, finding: FindingJson}} props */
function Finding({ group, finding }) {
	const view = group.views.find((candidate) => candidate.key === finding.view);
	const sure = finding.confidence === null ? '' : `, ${Math.round(finding.confidence * 100)} %`;
	const offered = finding.fix ? choices(group, finding.fix) : [];
	return html`
		<li class="finding" data-kind=${finding.kind}>
			<p>
				${view ? html`<button class="row-button" type="button" aria-label=${`Focus view ${view.letter}`} onClick=${() => focusView(view.letter)}><${Letter} letter=${view.letter} /></button>` : null}
				<strong>${capital(words(finding.kind))}${sure}.</strong> ${finding.sentence}
			</p>
			${offered.length === 0 ? null : html`
				<p class="finding__fixes">
					${offered.map(({ label, fix }) => {
						const edit = editOfFix(group, fix);
						return edit ? html`<button type="button" class="button button--fix" onClick=${() => submit(edit)}>${label}</button>` : null;
					})}
				</p>`}
		</li>
	`;
}

/** @param {{group: GroupDocument, solution: SolutionJson}} props */
export function Findings({ group, solution }) {
	const { findings } = solution;
	if (findings.length === 0) return null;
	return html`
		<section class="card" aria-label="Findings">
			<h2>Findings · ${findings.length}</h2>
			<ul class="findings">
				${findings.map((finding, i) => html`<${Finding} key=${i} group=${group} finding=${finding} />`)}
			</ul>
		</section>
	`;
}
