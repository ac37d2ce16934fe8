// @ts-check
/** What would mend the group on screen, the likeliest first: proposed lines, findings with a fix, missing balls and lines, remedies. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { plural } from '../lib/format.js';
import { findingTitle } from './advice.js';
import { editOf } from './edits.js';
import { group, groupDocument, solution } from './group.js';
import { remedies } from './insight.js';
import { openProposals, scoreWords, settledState, stateOf, waitingViews } from './proposal_lines.js';
import { fitPanel, returnLent } from './viewports.js';
import { focused } from './workspace.js';

/** @import {ViewProposalJson} from '../api/proposals.js' */
/** @import {FindingJson, FixJson, GroupDocument, OfferJson, SolutionJson, ViewJson} from '../api/types.js' */
/** @import {Edit} from './edits.js' */
/** @import {Remedy} from './insight.js' */

/**
 * @typedef {object} Mend one thing that a person can do about a group
 * @property {FixJson} fix what it is about; beside the server's actions `place_ball`, `draw_ball`, `resize_ball` and `accept_proposal`
 * @property {Edit | null} edit null: it leads the person to the place and leaves the drawing to them
 * @property {string | null} title null: that of the gate that fails
 * @property {string} sentence
 * @property {string} label of its button
 * @property {boolean} passes whether the solver found that the group would pass
 */

/** Which of them the card shows. */
const chosen = signal(0);

/** Buttons of what leads a person to the place. */
const GUIDES = /** @type {Record<string, string>} */ ({
	draw_marking: 'Draw it', look_ball: 'Show the place', place_ball: 'Place it there', draw_ball: 'Draw it', resize_ball: 'Fit the box', read_paint: 'Read its paint',
	accept_proposal: 'Accept the lines',
});

/** @typedef {Pick<Mend, 'fix' | 'edit' | 'label'>} Way */

/** @param {string} action @param {string | null} view @param {Partial<FixJson>} [more] @returns {Way} */
function guide(action, view, more = {}) {
	return { fix: { action, view, marking: null, to: null, index: null, ...more }, edit: null, label: GUIDES[action] };
}

/** @param {FixJson} fix @param {OfferJson[]} offers @returns {Way[]} */
function offered(fix, offers) {
	return offers.map(({ label, edit }) => ({ fix, edit: editOf(edit), label }));
}

/** @param {FindingJson} finding @returns {Way[]} */
function waysOf({ kind, view, marking, fix, offers }) {
	if (kind === 'visible_not_annotated') return [guide('draw_marking', view, { marking })];
	if (kind === 'ball_size') return [guide('resize_ball', view)];
	if (fix?.action === 'read_paint') return [guide('read_paint', view)];
	return fix ? offered(fix, offers) : [];
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

/** @param {GroupDocument} shown @param {SolutionJson} solved @returns {Mend[]} */
function missingBalls(shown, solved) {
	return blindViews(shown, solved).flatMap((view) => {
		const place = solved.views.find((one) => one.view === view.key)?.expected?.place;
		// Where there is no 3D ball yet, another view's ball may bring it.
		if (solved.ball ? !(place && inPicture(view, place)) : solved.passes) return [];
		const why = NEEDS_A_PAIR.has(solved.first_failing?.gate ?? '') ? ` With it ${view.letter} may make the pair that is missing.` : '';
		return [{
			...(place ? guide('place_ball', view.key, { point: place }) : guide('draw_ball', view.key)),
			title: `No ball is drawn in ${view.letter}`, passes: false,
			sentence: (place ? 'A green cross marks where the other views see it. If it is not visible there, press O.'
				: 'The dotted line is the ray of another view: the ball lies on it. If it is not visible, press O.') + why,
		}];
	});
}

/** Lines that are proposed for views without a camera. @param {GroupDocument} shown @param {ReadonlyMap<string, ViewProposalJson>} proposed @returns {Mend[]} */
function proposedLines(shown, proposed) {
	return shown.views.flatMap((view) => {
		const item = proposed.get(view.key);
		if (item?.outcome !== 'proposed') return [];
		const drawn = Object.keys(view.lines).length && !item.sentence ? ' What is drawn stays.' : '';
		return [{
			...guide('accept_proposal', view.key), passes: false,
			title: `${plural(Object.keys(item.lines).length, 'line')} ${Object.keys(item.lines).length === 1 ? 'is' : 'are'} proposed for ${view.letter}`,
			sentence: [`Violet and dashed, read from its paint: ${scoreWords(item)}.${drawn}`, item.sentence].filter(Boolean).join(' '),
		}];
	});
}

/** @param {Remedy} remedy @returns {Mend[]} */
function ofRemedy({ edit: fix, offers, sentence, passes }) {
	const ways = fix.action in GUIDES ? [guide(fix.action, fix.view, fix)] : offered(fix, offers);
	return ways.map((way) => ({ ...way, title: null, sentence: `${passes ? 'It would pass' : 'It would come closer'} if ${sentence}.`, passes }));
}

/** @param {FixJson} a @param {FixJson} b */
function isSame(a, b) {
	return a.action === b.action && a.view === b.view && a.marking === b.marking && a.index === b.index;
}

/**
 * What would mend a group. Proposed lines come first, and the card waits for them (`isHeld`); after them
 * what is known at once comes before what the solver tries out, so that nothing moves under a finger.
 *
 * @param {GroupDocument} shown @param {SolutionJson | null} solved @param {readonly Remedy[]} helping
 * @param {ReadonlyMap<string, ViewProposalJson>} proposed
 * @returns {Mend[]}
 */
function mendsOf(shown, solved, helping, proposed) {
	// Without its camera a view says nothing of the ball: that comes before everything else.
	const lines = proposedLines(shown, proposed);
	if (!solved) return lines;
	const missing = missingBalls(shown, solved);
	const short = solved.first_failing?.gate === 'ball';
	const found = solved.findings.flatMap((finding) => waysOf(finding).map((way) => ({
		...way, title: findingTitle(shown, finding), sentence: finding.sentence,
		passes: helping.some((remedy) => remedy.passes && isSame(remedy.edit, way.fix)),
	})));
	const known = short ? [...missing, ...found] : [...found, ...missing];
	const more = helping.flatMap(ofRemedy).filter(({ fix }) => !known.some((mend) => isSame(mend.fix, fix)));
	return [...lines, ...known, ...more];
}

/** Everything that would mend the group on screen. */
export const mends = computed(() => {
	const shown = group.value;
	if (!shown) return [];
	const known = remedies.value?.key.startsWith(`remedies ${shown.id} `) ? remedies.value.items : [];
	return mendsOf(shown, solution.value, known, openProposals.value);
});

/** Which of them is meant: its place from 0, -1 without any. */
export const mendIndex = computed(() => Math.min(chosen.value, mends.value.length - 1));
/** Whether lines may still be proposed that would come first: until that is known the card offers nothing. */
export const isHeld = computed(() => {
	const saved = groupDocument.value;
	if (!saved || settledState.value === stateOf(saved) || waitingViews(saved).length === 0) return false;
	return ![...openProposals.value.values()].some(({ outcome }) => outcome === 'proposed');
});
/** The one that the card shows and Enter carries out. */
export const mend = computed(() => (isHeld.value ? null : mends.value[mendIndex.value] ?? null));

/** The finding that the card speaks about; null where it speaks of something else. */
export const toldFinding = computed(() => {
	const findings = solution.value?.findings ?? [];
	const meant = mend.value;
	if (!meant?.title) return findings[0] ?? null;
	return findings.find(({ sentence, view }) => sentence === meant.sentence && view === meant.fix.view) ?? null;
});

/** Show another one. @param {number} step */
export function turnMend(step) {
	const count = mends.value.length;
	if (count) chosen.value = (mendIndex.value + step + count) % count;
}

/** Begin with the first one in every group, and after everything that changed it. */
export function startMends() {
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
	const meant = group.value?.views.find(({ key }) => key === mends.value[mendIndex.value]?.fix.view);
	if (!meant) return;
	focused.value = meant.letter;
	fitPanel(meant.letter);
}
