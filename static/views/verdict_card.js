// @ts-check
/** One sentence about the group: passes, or the first gate that fails. */

import { html } from 'htm/preact';

import { ballOf } from '../geometry/preview.js';
import { capital, words } from '../lib/format.js';
import { isBlind, REASONS } from '../state/verdicts.js';
import { GATE_TITLES, gateLabel } from './gate_names.js';

/** @import {GroupDocument, SolutionJson, VerdictJson, ViewJson} from '../api/types.js' */

/** Findings that say why a view does not meet the others. */
const ODD = new Set(['view_disagrees', 'sides_swapped', 'not_synchronous']);

/** What a gate asks, before what it got. @param {GroupDocument} group @param {SolutionJson} solution @param {string} name */
function asked(group, solution, name) {
	const gate = solution.gates.find((one) => one.name === name);
	return gate ? `${gateLabel(gate, group.policy)}: ` : '';
}

/** @param {GroupDocument} group @param {SolutionJson | null} solution */
function headline(group, solution) {
	if (!solution) {
		return { tone: 'unseen', over: 'Not solved', title: 'No numbers yet', text: 'Solve the dataset, or edit this group: it is solved with every edit.' };
	}
	const used = solution.ball?.views.length ?? 0;
	const all = group.views.length;
	const odd = solution.findings.find((finding) => finding.view !== null && ODD.has(finding.kind));
	if (!solution.passes) {
		const failing = solution.first_failing;
		const gate = failing ? (GATE_TITLES[failing.gate] ?? capital(words(failing.gate))) : 'A gate fails';
		return { tone: 'bad', over: 'Does not pass', title: gate, text: failing ? `${asked(group, solution, failing.gate)}${failing.sentence}.` : '' };
	}
	const doubt = solution.findings[0];
	if (odd || used < all) {
		const letter = group.views.find((view) => view.key === odd?.view)?.letter;
		const title = !letter || !odd ? `${used} of ${all} views agree`
			: odd.kind === 'view_disagrees' ? `View ${letter} disagrees with the others`
				: `${capital(words(odd.kind))} in ${letter}`;
		return { tone: 'warn', over: `Passes with ${used} of ${all} views`, title, text: odd?.sentence ?? missing(group, solution) };
	}
	if (doubt) return { tone: 'warn', over: 'Passes, worth a look', title: capital(words(doubt.kind)), text: doubt.sentence };
	return { tone: 'ok', over: 'Passes every gate', title: all === 2 ? 'Both views agree' : `All ${all} views agree`, text: spread(solution) };
}

/** @param {GroupDocument} group @param {SolutionJson} solution */
function missing(group, solution) {
	const out = group.views.filter((view) => !solution.ball?.views.includes(view.key));
	const blind = out.filter((view) => view.included && !ballOf(view));
	const others = out.filter((view) => !blind.includes(view));
	const letters = (/** @type {ViewJson[]} */ views) => views.map(({ letter }) => letter).join(', ');
	return [
		blind.length ? `No ball in ${letters(blind)}.` : '', others.length ? `Not used: ${letters(others)}.` : '',
	].filter(Boolean).join(' ');
}

/** @param {SolutionJson} solution */
function spread(solution) {
	const errors = solution.views.flatMap(({ ball }) => (ball?.error_px === null || !ball ? [] : [ball.error_px]));
	return errors.length ? `The ball is met within ${Math.max(...errors).toFixed(1)} px in every view.` : '';
}

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
	const { tone, over, title, text } = headline(group, solution);
	const { verdict } = group;
	return html`
		<section class="card verdict-card" data-tone=${tone === 'ok' && isBlind(group) ? 'warn' : tone} data-live=${live} aria-label="Result">
			<p class="verdict-card__over">${over}</p>
			<h1>${title}</h1>
			<p class="verdict-card__text">${text}</p>
			${isBlind(group) ? html`<p><span class="pill" data-status="no-picture">no picture</span> <span data-grade="warn">No view of this group has a picture to look at.</span></p>` : null}
			${verdict.state === 'unreviewed' && !verdict.note ? null : html`
				<p class="verdict-card__verdict">
					<span class="pill" data-status=${verdict.state}>${verdictText(verdict)}</span>
					${verdict.stale ? html`<span class="pill" data-status="stale">stale: changed since</span>` : null}
					${verdict.fixed ? html`<span class="pill">fixed</span>` : null}
				</p>`}
		</section>
	`;
}
