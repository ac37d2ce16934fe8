// @ts-check
/** What would mend the group on screen, the likeliest first: findings with a fix, missing balls and lines, remedies. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { ballOf } from '../geometry/preview.js';
import { findingTitle } from './advice.js';
import { editOfFix } from './edits.js';
import { group, groupDocument, solution } from './group.js';
import { remedies } from './insight.js';
import { fitPanel, returnLent } from './viewports.js';
import { focused } from './workspace.js';

/** @import {FindingJson, FixJson, GroupDocument, SolutionJson, ViewJson} from '../api/types.js' */
/** @import {Remedy} from './insight.js' */

/**
 * @typedef {object} Mend one thing that a person can do about a group
 * @property {FixJson} fix what to do; beside the server's actions `place_ball` and `draw_ball`
 * @property {string | null} title null: that of the gate that fails
 * @property {string} sentence
 * @property {string} label of its button
 * @property {boolean} passes whether the solver found that the group would pass
 */

/** Which of them the card shows. */
const chosen = signal(0);

/** @param {FixJson} fix */
function labelOf({ action, to, index }) {
	if (action === 'relabel') return `Relabel as ${to}`;
	if (action === 'pick_ball') return `Keep ball ${(index ?? 0) + 1}`;
	return {
		swap_sides: 'Swap left and right', move_point: 'Move the point', drop_point: 'Drop the point', drop_marking: 'Drop the line',
		draw_marking: 'Draw it', look_ball: 'Show the place', include_view: 'Use it again', exclude_view: 'Leave it out',
		place_ball: 'Place it there', draw_ball: 'Draw it', resize_ball: 'Fit the box',
	}[action] ?? action;
}

/** @param {string} action @param {string | null} view @param {Partial<FixJson>} [more] @returns {FixJson} */
function fixOf(action, view, more = {}) {
	return { action, view, marking: null, to: null, index: null, ...more };
}

/** @param {GroupDocument} shown @param {FindingJson} finding @returns {FixJson[]} */
function fixesOf(shown, finding) {
	const view = shown.views.find(({ key }) => key === finding.view);
	if (finding.kind === 'visible_not_annotated') return [fixOf('draw_marking', finding.view, { marking: finding.marking })];
	if (finding.kind === 'ball_size') return [fixOf('resize_ball', finding.view)];
	if (!finding.fix) return [];
	if (finding.fix.action !== 'pick_ball' || !view || ballOf(view)) return [finding.fix];
	return view.balls.flatMap((ball, index) => (ball.out_of_view || !finding.fix ? [] : [{ ...finding.fix, index }]));
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
		const fix = place ? fixOf('place_ball', view.key, { point: place }) : fixOf('draw_ball', view.key);
		const why = NEEDS_A_PAIR.has(solved.first_failing?.gate ?? '') ? ` With it ${view.letter} may make the pair that is missing.` : '';
		return [{
			fix, title: `No ball is drawn in ${view.letter}`, label: labelOf(fix), passes: false,
			sentence: (place ? 'A green cross marks where the other views see it. If it is not visible there, press O.'
				: 'The dotted line is the ray of another view: the ball lies on it. If it is not visible, press O.') + why,
		}];
	});
}

/** @param {Remedy} remedy @returns {Mend} */
function ofRemedy({ edit, sentence, passes }) {
	return { fix: edit, title: null, sentence: `${passes ? 'It would pass' : 'It would come closer'} if ${sentence}.`, label: labelOf(edit), passes };
}

/** @param {FixJson} a @param {FixJson} b */
function isSame(a, b) {
	return a.action === b.action && a.view === b.view && a.marking === b.marking && a.index === b.index;
}

/**
 * What would mend a group. What is known at once comes first, so that nothing moves under a finger.
 *
 * @param {GroupDocument} shown @param {SolutionJson | null} solved @param {readonly Remedy[]} helping
 * @returns {Mend[]}
 */
export function mendsOf(shown, solved, helping) {
	if (!solved) return [];
	const missing = missingBalls(shown, solved);
	const short = solved.first_failing?.gate === 'ball';
	const found = solved.findings.flatMap((finding) => fixesOf(shown, finding).map((fix) => ({
		fix, title: findingTitle(shown, finding), sentence: finding.sentence, label: labelOf(fix),
		passes: helping.some((remedy) => remedy.passes && isSame(remedy.edit, fix)),
	})));
	const known = short ? [...missing, ...found] : [...found, ...missing];
	const more = helping.map(ofRemedy).filter(({ fix }) => !known.some((mend) => isSame(mend.fix, fix)));
	// What only a person can do is no edit; any other that cannot be carried out is not offered.
	return [...known, ...more].filter(({ fix }) => GUIDED.has(fix.action) || editOfFix(shown, fix) !== null);
}

/** Actions that lead a person to the place and leave the drawing to them. */
const GUIDED = new Set(['draw_marking', 'look_ball', 'draw_ball', 'place_ball', 'resize_ball']);

/** Everything that would mend the group on screen. */
export const mends = computed(() => {
	const shown = group.value;
	if (!shown) return [];
	const known = remedies.value?.key.startsWith(`remedies ${shown.id} `) ? remedies.value.items : [];
	return mendsOf(shown, solution.value, known);
});

/** Which of them is meant: its place from 0, -1 without any. */
export const mendIndex = computed(() => Math.min(chosen.value, mends.value.length - 1));
/** The one that the card shows and Enter carries out. */
export const mend = computed(() => mends.value[mendIndex.value] ?? null);

/** The finding that the card speaks about; null where it speaks of something else. */
export const told = computed(() => {
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
	let at = { id: 0, etag: '' };
	return effect(() => {
		const { id = 0, etag = '' } = groupDocument.value ?? {};
		if (id !== at.id || etag !== at.etag) chosen.value = 0;
		if (id !== at.id) untracked(focusMeant);
		at = { id, etag };
	});
}

/** Keys speak about the view that the card speaks about, and it is seen whole, whatever was looked at before. */
function focusMeant() {
	returnLent();
	const meant = group.value?.views.find(({ key }) => key === mend.value?.fix.view);
	if (!meant) return;
	focused.value = meant.letter;
	fitPanel(meant.letter);
}
