// @ts-check
/** One sentence about the group: passes, or the first gate that fails. */

import { html } from 'htm/preact';

import { ballOf } from '../geometry/preview.js';
import { capital, words } from '../lib/format.js';
import { findingTitle, saysApart } from '../state/advice.js';
import { dismissTold } from '../state/dismissals.js';
import { mend, toldFinding } from '../state/mends.js';
import { openFindings } from '../state/open_findings.js';
import { REASONS } from '../state/reasons.js';
import { isBlind } from '../state/verdicts.js';
import { GATE_TITLES, gateLabel } from './gate_names.js';
import { PitchLink } from './findings.js';
import { MendBox } from './mend_box.js';

/** @import {GroupDocument, SolutionJson, VerdictJson, ViewJson} from '../api/types.js' */
/** @import {Mend} from '../state/mends.js' */

/** @typedef {{tone: 'ok' | 'warn' | 'bad' | 'unseen', over: string, title: string, text: string}} Headline */

/** What a gate asks, before what it got. @param {GroupDocument} group @param {SolutionJson} solution @param {string} name */
function asked(group, solution, name) {
	const gate = solution.gates.find((one) => one.name === name);
	return gate ? `${gateLabel(gate, group.policy)} — ` : '';
}

/**
 * What there is to say about a group: the finding that the offered mend is for, else the one that explains most.
 *
 * @param {GroupDocument} group @param {SolutionJson | null} solution @param {Mend | null} offered
 * @returns {Headline}
 */
function headline(group, solution, offered) {
	if (!solution && offered?.title) return { tone: 'unseen', over: 'Not solved', title: offered.title, text: offered.sentence };
	if (!solution) {
		return { tone: 'unseen', over: 'Not solved', title: 'No numbers yet', text: 'Solve the dataset, or edit this group: each edit solves it.' };
	}
	const used = solution.ball?.views.length ?? 0;
	const all = group.views.length;
	const first = toldFinding.value;
	const told = first ? { title: findingTitle(group, first), sentence: first.sentence } : offered?.title ? offered : null;
	if (!solution.passes) {
		const failing = solution.first_failing;
		const gate = failing ? (GATE_TITLES[failing.gate] ?? capital(words(failing.gate))) : 'A gate fails';
		const measured = failing ? `${asked(group, solution, failing.gate)}${failing.sentence}.` : '';
		if (!told) return { tone: 'bad', over: 'Does not pass', title: gate, text: measured };
		return { tone: 'bad', over: `Does not pass: ${lower(gate)}`, title: told.title ?? gate, text: told.sentence };
	}
	if (first?.unusable_ball) return { tone: 'bad', over: 'Passes, but the ball cannot be used', title: told?.title ?? '', text: told?.sentence ?? '' };
	if (used === all && (openFindings(solution).some(saysApart) || misses(group, solution))) {
		return { tone: 'warn', over: 'Passes, but its views disagree', title: told?.title ?? 'The views disagree', text: told?.sentence ?? '' };
	}
	if (used < all) {
		return {
			tone: 'warn', over: `Passes with ${used} of ${all} views`, title: told?.title ?? `${used} of ${all} views agree`,
			text: told?.sentence ?? missing(group, solution),
		};
	}
	if (told) return { tone: 'warn', over: 'Passes, worth a look', title: told.title ?? '', text: told.sentence };
	return { tone: 'ok', over: 'Passes every gate', title: all === 2 ? 'Both views agree' : `All ${all} views agree`, text: [spread(solution), unused(group, solution)].filter(Boolean).join(' ') };
}

/** Whether the 3D ball misses a view that counts, as it may while a ball is dragged, before the server has found it. @param {GroupDocument} group @param {SolutionJson} solution */
function misses(group, solution) {
	return solution.views.some(({ included, ball }) => included && (ball?.error_percent ?? 0) > group.policy.tau_percent);
}

/** @param {string} title */
function lower(title) {
	return title.charAt(0).toLowerCase() + title.slice(1);
}

/** @param {GroupDocument} group @param {SolutionJson} solution */
function missing(group, solution) {
	const out = group.views.filter((view) => !solution.ball?.views.includes(view.key));
	const blind = out.filter((view) => view.included && !ballOf(view));
	const others = out.filter((view) => !blind.includes(view));
	const letters = (/** @type {ViewJson[]} */ views) => views.map(({ letter }) => letter).join(', ');
	return [
		blind.length ? `No ball is drawn in ${letters(blind)}.` : '', others.length ? `Not used: ${letters(others)}.` : '',
	].filter(Boolean).join(' ');
}

/** @param {SolutionJson} solution */
function spread(solution) {
	const errors = solution.views.flatMap(({ ball }) => (ball?.error_px === null || !ball ? [] : [ball.error_px]));
	return errors.length ? `Every view sees the ball in the same place, within ${Math.max(...errors).toFixed(1)} px.` : '';
}

/** Drawn lines that the cameras do without, red in the pictures though nothing fails. @param {GroupDocument} group @param {SolutionJson} solution */
function unused(group, solution) {
	const sentences = group.views.flatMap((view) => {
		const markings = solution.views.find((one) => one.view === view.key)?.calibration.markings ?? [];
		const names = markings.filter(({ marking, used, outcome }) => view.lines[marking] && (!used || outcome !== 'tp')).map(({ marking }) => `“${marking}”`);
		return names.length ? [`${names.join(' and ')} of ${view.letter} ${names.length > 1 ? 'do' : 'does'} not fit (does not block; see Lines).`] : [];
	});
	return sentences.join(' ');
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
