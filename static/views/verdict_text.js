// @ts-check
/** What a group comes to, in one sentence: it passes, or what is wrong with it. */

import { ballOf, diagonal } from '../geometry/preview.js';
import { capital, pixelText, words } from '../lib/format.js';
import { ballError } from '../overlays/scene.js';
import { findingTitle, saysApart } from '../state/advice.js';
import { shownFinding } from '../state/suggestions.js';
import { openFindings } from '../state/open_findings.js';
import { GATE_TITLES, gateLabel } from './gate_names.js';
import { gradeOfView, uncertainViews } from './view_state.js';

/** @import {GroupDocument, SolutionJson, ViewJson} from '../api/types.js' */
/** @import {Suggestion} from '../state/suggestions.js' */

/** @typedef {{view: string, letter: string, marking: string | null, text: string}} Remark   about a view, or a marking of it */
/** @typedef {{tone: 'ok' | 'warn' | 'bad' | 'unseen', over: string, title: string, text: string, remarks?: Remark[]}} Headline */

/** Below: consistent views have errors as large as these in fewer than one of twenty groups. */
const UNLIKELY_P_VALUE = 0.05;

/** What a gate asks, before what it got. @param {GroupDocument} group @param {SolutionJson} solution @param {string} name */
function asked(group, solution, name) {
	const gate = solution.gates.find((one) => one.name === name);
	return gate ? `${gateLabel(gate, group.policy)} — ` : '';
}

/**
 * What there is to say about a group: the finding that the offered mend is for, else the one that explains most.
 *
 * @param {GroupDocument} group @param {SolutionJson | null} solution @param {Suggestion | null} offered
 * @returns {Headline}
 */
export function headline(group, solution, offered) {
	const found = sentences(group, solution, offered);
	return solution ? { ...found, remarks: [...uncertain(group, solution), ...(found.remarks ?? [])] } : found;
}

/** @param {GroupDocument} group @param {SolutionJson | null} solution @param {Suggestion | null} offered @returns {Headline} */
function sentences(group, solution, offered) {
	if (!solution && offered?.title) return { tone: 'unseen', over: 'Not solved', title: offered.title, text: offered.sentence };
	if (!solution) {
		return { tone: 'unseen', over: 'Not solved', title: 'No numbers yet', text: 'Solve the dataset, or edit this group: each edit solves it.' };
	}
	const used = solution.ball?.views.length ?? 0;
	const all = group.views.length;
	const first = shownFinding.value;
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
			tone: 'warn', over: `Passes with ${used} of ${all} views`, title: told?.title ?? agreement(`${used} of ${all} views`, solution),
			text: told?.sentence ?? missing(group, solution),
		};
	}
	if (told) return { tone: 'warn', over: 'Passes, but has a finding', title: told.title ?? '', text: told.sentence };
	return {
		tone: isUnlikely(solution) ? 'warn' : 'ok', over: 'Passes every gate', title: agreement(all === 2 ? 'Both views' : `All ${all} views`, solution),
		text: spread(solution), remarks: unused(group, solution),
	};
}

/** How consistent the views are, as the gate says it. @param {SolutionJson} solution */
function consistency({ gates }) {
	return gates.find(({ name }) => name === 'chi_square');
}

/** Whether views that fit have errors as large as these in fewer than one of twenty groups. @param {SolutionJson} solution */
function isUnlikely(solution) {
	return (consistency(solution)?.value ?? 1) < UNLIKELY_P_VALUE;
}

/** That the views agree, or how unlikely it is. @param {string} views @param {SolutionJson} solution */
function agreement(views, solution) {
	return isUnlikely(solution) ? `${views} are used; their agreement is ${consistency(solution)?.sentence}` : `${views} agree`;
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
		blind.length ? `No ball is drawn in ${letters(blind)}.` : '',
		others.length ? `Not used: ${others.map((view) => `${view.letter} (${whyUnused(group, solution, view)})`).join(', ')}.` : '',
	].filter(Boolean).join(' ');
}

/** Why the 3D ball does without a view that shows the ball. @param {GroupDocument} group @param {SolutionJson} solution @param {ViewJson} view */
function whyUnused(group, solution, view) {
	const solved = solution.views.find((one) => one.view === view.key) ?? null;
	if (view.included && solved?.failed === 'jac') return 'lines do not fit';
	const px = ballError(view.key, solution);
	const tau = (group.policy.tau_percent / 100) * diagonal(view);
	const { sentence, grade } = gradeOfView({ view, solved, ball: solved?.ball ?? null, apart: px, tau });
	return grade === 'bad' && (px ?? 0) > tau && !solved?.failed ? `error ${pixelText(px)}, at most ${pixelText(tau)}` : sentence;
}

/** @param {SolutionJson} solution */
function spread(solution) {
	const errors = solution.views.flatMap(({ ball }) => (ball?.error_px === null || !ball ? [] : [ball.error_px]));
	if (!errors.length) return '';
	// Nothing lies within 0.0 px.
	const most = pixelText(Math.max(0.1, ...errors));
	return isUnlikely(solution) ? `The largest error of the ball is ${most}.` : `Every view sees the ball in the same place, within ${most}.`;
}

/** Drawn lines that the cameras do without, red in the pictures though nothing fails. @param {GroupDocument} group @param {SolutionJson} solution @returns {Remark[]} */
function unused(group, solution) {
	return group.views.flatMap((view) => {
		const markings = solution.views.find((one) => one.view === view.key)?.calibration.markings ?? [];
		return markings.filter(({ marking, used, outcome }) => view.lines[marking] && (!used || outcome !== 'tp'))
			.map(({ marking }) => ({ view: view.key, letter: view.letter, marking, text: 'does not fit; the group passes without it.' }));
	});
}

/** Cameras that the lines do not determine, unless the card speaks about them anyway. @param {GroupDocument} group @param {SolutionJson} solution @returns {Remark[]} */
function uncertain(group, solution) {
	const told = shownFinding.value;
	return uncertainViews(group, solution)
		.filter(({ view }) => !(told?.kind === 'under_constrained' && told.view === view.key))
		.map(({ view, guess }) => ({ view: view.key, letter: view.letter, marking: null, text: `has an uncertain camera: its lines do not determine the ${guess}.` }));
}
