// @ts-check
/** What would correct the group on screen, the likeliest first: proposed lines, findings, missing balls, remedies. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { plural } from '../lib/format.js';
import { findingTitle, isGrave } from './advice.js';
import { placeExpected } from './drawing.js';
import { editOf } from './edits.js';
import { group, groupDocument, solution } from './group.js';
import { remedies } from './insight.js';
import { openFindings } from './open_findings.js';
import { lookedAt, openProposals, scoreWords, settledState, stateOf, waitingViews, waitsForLines } from './proposal_lines.js';
import { fitPanel, returnLent } from './viewports.js';
import { focused } from './workspace.js';

/** @import {ViewProposalJson} from '../api/proposals.js' */
/** @import {FindingJson, GroupDocument, GuideJson, OfferJson, PairJson, SolutionJson, ViewJson} from '../api/types.js' */
/** @import {Edit} from './edits.js' */
/** @import {Remedy} from './insight.js' */

/**
 * @typedef {object} Way how something is mended: by an edit, by leading the person to the place, or by what is known here alone
 * @property {string} label of its button
 * @property {string} caption words beside the place in the picture
 * @property {Edit | null} [edit]
 * @property {Partial<GuideJson> & {ball?: boolean}} [guide] ball: the ball is to be drawn
 * @property {(view: ViewJson) => void} [run]
 */
/**
 * @typedef {object} About what a suggestion speaks about
 * @property {string | null} view
 * @property {string | null} [marking]
 * @property {number | null} [index] of a point of the marking
 * @property {PairJson | null} [point] where that point would have to stand, image pixels
 */
/**
 * @typedef {Way & About & {title: string | null, sentence: string, passes: boolean, finding?: FindingJson}} Suggestion one thing that a person can do
 *   about a group; title null: that of the gate that fails; passes: whether the solver found that the group would pass; finding: that it mends
 */

/** Which of them the card shows. */
const chosen = signal(0);

/** @param {{offers: OfferJson[], guide: GuideJson | null}} told @returns {Way[]} */
function waysOf({ offers, guide }) {
	const edits = offers.map(({ label, caption, edit }) => ({ label, caption, edit: editOf(edit) }));
	return guide ? [...edits, { label: guide.label, caption: guide.caption, guide }] : edits;
}

/** Gates that one more view with a ball may meet. */
const NEEDS_A_PAIR = new Set(['baseline', 'parallax', 'reprojection']);

/** Views that could show the ball, and where nobody has said anything of it. @param {GroupDocument} shown @param {SolutionJson} solved */
function blindViews(shown, solved) {
	return shown.views.filter((view) => view.included && view.balls.length === 0
		&& solved.views.some((one) => one.view === view.key && one.calibration.camera && one.failed === null));
}

/** @param {ViewJson} view @param {[number, number]} place */
function inPicture({ width, height }, [x, y]) {
	return x >= 0 && y >= 0 && x < width && y < height;
}

/** @param {GroupDocument} shown @param {SolutionJson} solved @returns {Suggestion[]} */
function missingBalls(shown, solved) {
	return blindViews(shown, solved).flatMap((view) => {
		const place = solved.views.find((one) => one.view === view.key)?.expected?.place;
		// Where there is no 3D ball yet, another view's ball may bring it.
		if (solved.ball ? !(place && inPicture(view, place)) : solved.passes) return [];
		const seen = shown.views.some((other) => other !== view && other.balls.length > 0 && solved.views.some((one) => one.view === other.key && one.calibration.camera));
		const where = seen ? 'The dotted line is the ray of another view: the ball lies on it.' : 'No other view shows where the ball is.';
		const why = NEEDS_A_PAIR.has(solved.first_failing?.gate ?? '') ? ` With a ball in view ${view.letter}, the group may get the valid pair that it needs.` : '';
		return [{
			view: view.key, caption: '',
			...(place ? { label: 'Place it there', run: placeExpected } : { label: 'Draw it', guide: { ball: true } }),
			title: `No ball is drawn in ${view.letter}`, passes: false,
			sentence: (place ? 'A green cross marks where the other views see it. If it is not visible there, press O.'
				: `${where} If it is not visible, press O.`) + why,
		}];
	});
}

/** To look for lines in the picture of a view that nobody has looked at. @param {GroupDocument} shown @param {SolutionJson | null} solved @param {ViewJson} view @returns {Suggestion} */
function lookForLines(shown, solved, view) {
	const finding = solved?.findings.find((one) => one.kind === 'under_constrained' && one.view === view.key);
	return {
		view: view.key, caption: '', passes: false, finding,
		label: lookedAt.value.has(view.id) ? 'Looking…' : 'Propose lines',
		title: finding ? findingTitle(shown, finding) : `View ${view.letter} has no lines`,
		sentence: finding?.sentence ?? 'Its picture may show them.',
		run: (at) => import('./proposals.js').then(({ proposeNow }) => proposeNow(at)),
	};
}

/** Lines that are proposed for views without a camera. @param {GroupDocument} shown @param {ReadonlyMap<string, ViewProposalJson>} proposed @returns {Suggestion[]} */
function proposedLines(shown, proposed) {
	return shown.views.flatMap((view) => {
		const item = proposed.get(view.key);
		if (item?.outcome !== 'proposed') return [];
		const drawn = Object.keys(view.lines).length && !item.sentence ? ' Lines already drawn are kept.' : '';
		return [{
			view: view.key, label: 'Accept the lines', caption: '', passes: false,
			run: (at) => import('./proposals.js').then(({ acceptProposal }) => acceptProposal(at)),
			title: `${plural(Object.keys(item.lines).length, 'line')} ${Object.keys(item.lines).length === 1 ? 'is' : 'are'} proposed for ${view.letter}`,
			sentence: [`Violet and dashed, read from its painted lines: ${scoreWords(item)}.${drawn}`, item.sentence].filter(Boolean).join(' '),
		}];
	});
}

/** @param {About} of @returns {About} */
function aboutOf({ view, marking = null, index = null, point = null }) {
	return { view, marking, index, point };
}

/** @param {GroupDocument} shown @param {FindingJson} finding @returns {Suggestion[]} */
function ofFinding(shown, finding) {
	const told = { title: findingTitle(shown, finding), sentence: finding.sentence, passes: false, finding };
	return waysOf(finding).map((way) => ({ ...aboutOf(finding.fix ?? finding), ...way, ...told }));
}

/** @param {Remedy} remedy @returns {Suggestion[]} */
function ofRemedy(remedy) {
	const { edit: fix, sentence, passes } = remedy;
	const told = { title: null, sentence: `${passes ? 'It would pass' : 'It would come closer'} if ${sentence}.`, passes };
	return waysOf(remedy).map((way) => ({ ...aboutOf(fix), ...way, ...told }));
}

/** Whether two are the same button about the same thing. @param {Suggestion} a @param {Suggestion} b */
function isSame(a, b) {
	return a.label === b.label && a.view === b.view && a.marking === b.marking && a.index === b.index;
}

/**
 * What would mend a group. Proposed lines come first, and the card waits for them (`isHeld`); after them
 * what is known at once comes before what the solver tries out, so that nothing moves under a finger.
 *
 * @param {GroupDocument} shown @param {SolutionJson | null} solved @param {readonly Remedy[]} helping
 * @param {ReadonlyMap<string, ViewProposalJson>} proposed
 * @returns {Suggestion[]}
 */
function suggestionsOf(shown, solved, helping, proposed) {
	// Without its camera a view says nothing of the ball: that comes before everything else.
	const lines = proposedLines(shown, proposed);
	const looks = shown.views.filter((view) => waitsForLines(view, solved) && !proposed.has(view.key)).map((view) => lookForLines(shown, solved, view));
	if (!solved) return [...lines, ...looks];
	const missing = missingBalls(shown, solved);
	const short = solved.first_failing?.gate === 'ball';
	const tried = helping.flatMap(ofRemedy);
	const found = openFindings(solved).flatMap((finding) => ofFinding(shown, finding))
		.map((suggestion) => ({ ...suggestion, passes: tried.some((remedy) => remedy.passes && isSame(remedy, suggestion)) }));
	const known = short ? [...missing, ...found] : [...found, ...missing];
	const more = tried.filter((remedy) => !known.some((suggestion) => isSame(remedy, suggestion)));
	return solved.passes ? [...lines, ...known, ...looks, ...more] : [...lines, ...looks, ...known, ...more];
}

/** Everything that would correct the group on screen. */
export const suggestions = computed(() => {
	const shown = group.value;
	if (!shown) return [];
	const known = remedies.value?.id === shown.id ? remedies.value.items : [];
	return suggestionsOf(shown, solution.value, known, openProposals.value);
});

/** Which of them is meant: its place from 0, -1 without any. */
export const suggestionIndex = computed(() => Math.min(chosen.value, suggestions.value.length - 1));
/** Whether lines may still be proposed that would come first: until that is known the card offers nothing. */
export const isHeld = computed(() => {
	const saved = groupDocument.value;
	if (!saved || settledState.value === stateOf(saved) || waitingViews(saved).length === 0) return false;
	return ![...openProposals.value.values()].some(({ outcome }) => outcome === 'proposed');
});
/** The one that the card shows and Enter carries out. */
export const suggestion = computed(() => (isHeld.value ? null : suggestions.value[suggestionIndex.value] ?? null));

/** The finding that the card speaks about: the worst, whatever else could be mended, else that of the suggestion; null where it speaks of something else. */
export const shownFinding = computed(() => {
	const meant = suggestion.value;
	const first = openFindings(solution.value)[0];
	if (first && isGrave(first, solution.value)) return first;
	return (meant?.title ? meant.finding : first) ?? null;
});

/** Whether the card's title is that of the suggestion that it offers. */
export const isSuggestionShown = computed(() => {
	const meant = suggestion.value;
	return Boolean(meant?.title) && (meant?.finding ?? null) === shownFinding.value;
});

/** Show another one. @param {number} step */
export function nextSuggestion(step) {
	const count = suggestions.value.length;
	if (count) chosen.value = (suggestionIndex.value + step + count) % count;
}

/** Begin with the first one in every group, and after everything that changed it. */
export function startSuggestions() {
	let at = { id: 0, etag: '', proposed: 0 };
	return effect(() => {
		const { id = 0, etag = '' } = groupDocument.value ?? {};
		const proposed = [...openProposals.value.values()].filter(({ outcome }) => outcome === 'proposed').length;
		if (id !== at.id || etag !== at.etag) chosen.value = 0;
		// They come first and a moment later: who has turned to another one by then keeps it.
		else if (proposed > at.proposed && chosen.peek() > 0) chosen.value = chosen.peek() + proposed - at.proposed;
		if (id !== at.id) untracked(focusMeant);
		at = { id, etag, proposed };
	});
}

/** Keys speak about the view that the card speaks about, and it is seen whole, whatever was looked at before. */
function focusMeant() {
	returnLent();
	const meant = group.value?.views.find(({ key }) => key === suggestions.value[suggestionIndex.value]?.view);
	if (!meant) return;
	focused.value = meant.letter;
	fitPanel(meant.letter);
}
