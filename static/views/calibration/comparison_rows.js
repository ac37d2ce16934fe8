// @ts-check
/** Before and after: what the staged lines change, number by number. */

import { gradeBelow, gradeOfJac } from '../../geometry/residual.js';
import { degrees, fixed, metres, pixelText, sharePercent } from '../../lib/format.js';
import { isUnjudged } from '../gate_names.js';
import { ballError } from '../../overlays/scene.js';

/** @import {GroupDocument, SolutionJson, ViewSolutionJson} from '../../api/types.js' */
/** @import {Grade} from '../../geometry/residual.js' */

/** @typedef {{name: string, label: string, before: string, after: string, change: 'better' | 'worse' | 'same' | 'other'}} ComparedRow */
/** @typedef {(solution: SolutionJson | null, solved: ViewSolutionJson | null) => number | null | undefined} Reading */
/**
 * @typedef {object} Measure
 * @property {string} name
 * @property {string} label
 * @property {Reading} read
 * @property {(value: number | null | undefined) => string} say
 * @property {1 | -1 | 0} better 1: more is better, -1: less is better
 * @property {number} step changes below this are none
 * @property {boolean} [rare] no row where neither side has the number
 */

/** @param {ViewSolutionJson | null} solved */
function worstLine(solved) {
	const all = (solved?.calibration.markings ?? []).flatMap(({ largest_px: px }) => (px === null ? [] : [px]));
	return all.length ? Math.max(...all) : null;
}

/** @param {number} digits @param {string} [unit] @returns {Measure['say']} */
const to = (digits, unit = '') => (value) => fixed(value, digits, unit);

/** @type {Measure['say']} */
const share = (value) => (value === null || value === undefined ? fixed(null, 0) : sharePercent(value));

/** @type {Measure[]} */
const MEASURES = [
	...['0.5', '1', '2'].map((gamma) => /** @type {Measure} */ ({
		name: `jac ${gamma}`, label: `JaC ${gamma} %`, read: (_, solved) => solved?.calibration.jac?.[gamma],
		say: to(2), better: 1, step: 0.005,
	})),
	{ name: 'median', label: 'Median error', read: (_, solved) => solved?.calibration.error_px, say: to(2, ' px'), better: -1, step: 0.005 },
	{ name: 'worst', label: 'Worst error', read: (_, solved) => worstLine(solved), say: pixelText, better: -1, step: 0.05 },
	{ name: 'supported', label: 'Markings with paint', read: (_, solved) => solved?.calibration.paint?.supported, say: share, better: 1, step: 0.005, rare: true },
	{ name: 'explained', label: 'Paint with a marking', read: (_, solved) => solved?.calibration.paint?.explained, say: share, better: 1, step: 0.005, rare: true },
	{ name: 'ball', label: 'Ball error here', read: (solution, solved) => (solved ? ballError(solved.view, solution) : null), say: pixelText, better: -1, step: 0.05 },
	{ name: 'ratio', label: 'Ball size ratio', read: (_, solved) => solved?.ball?.size_ratio, say: to(2, '×'), better: 0, step: 0.005 },
	{ name: 'gates', label: 'Gates passed', read: (solution) => solution?.gates.filter((gate) => gate.active && gate.passed && !isUnjudged(gate)).length, say: to(0), better: 1, step: 0.5 },
	{ name: 'views', label: 'Views of the 3D ball', read: (solution) => solution?.ball?.views.length ?? 0, say: to(0), better: 1, step: 0.5 },
	{ name: 'x', label: 'Ball x', read: (solution) => solution?.ball?.point[0], say: metres, better: 0, step: 0.005 },
	{ name: 'y', label: 'Ball y', read: (solution) => solution?.ball?.point[1], say: metres, better: 0, step: 0.005 },
	{ name: 'height', label: 'Ball height', read: (solution) => solution?.ball?.height_m, say: metres, better: 0, step: 0.005 },
	{ name: 'sigma', label: 'σ', read: (solution) => solution?.ball?.sigma_m, say: metres, better: -1, step: 0.005 },
	{ name: 'parallax', label: 'Parallax', read: (solution) => solution?.ball?.parallax_degrees, say: degrees, better: 0, step: 0.05 },
];

/**
 * @param {string} view key
 * @param {SolutionJson | null} before @param {SolutionJson | null} after
 * @returns {ComparedRow[]}
 */
export function comparedRows(view, before, after) {
	/** @param {SolutionJson | null} solution */
	const solvedOf = (solution) => solution?.views.find((one) => one.view === view) ?? null;
	const [old, next] = [solvedOf(before), solvedOf(after)];
	return MEASURES.flatMap((measure) => {
		const [a, b] = [measure.read(before, old), measure.read(after, next)];
		if (measure.rare && (a ?? b ?? null) === null) return [];
		return [{
			name: measure.name, label: measure.label, before: measure.say(a), after: measure.say(b), change: changeOf(measure, a, b),
		}];
	});
}

/** @param {Measure} measure @param {number | null | undefined} a @param {number | null | undefined} b @returns {ComparedRow['change']} */
function changeOf({ better, step }, a, b) {
	const [had, has] = [a ?? null, b ?? null];
	if (had === null || has === null) return had === has ? 'same' : had === null ? 'better' : 'worse';
	const off = has - had;
	if (Math.abs(off) < step) return 'same';
	if (better === 0) return 'other';
	return off * better > 0 ? 'better' : 'worse';
}

/**
 * The one sentence above the table.
 *
 * @param {GroupDocument} group @param {string} view @param {SolutionJson | null} solution
 * @returns {{text: string, grade: Grade}}
 */
export function summaryOf(group, view, solution) {
	const solved = solution?.views.find((one) => one.view === view);
	const jac = solved?.calibration.jac?.['0.5'];
	if (!solution || !solved) return { text: 'Not solved yet.', grade: 'unseen' };
	if (!solved.calibration.camera) return { text: 'No camera from these lines.', grade: 'bad' };
	if (solution.passes) return { text: 'The group passes every gate.', grade: 'ok' };
	const failing = solution.first_failing;
	if (failing) return { text: `Fails ${failing.gate.replaceAll('_', ' ')}: ${failing.sentence}`, grade: 'bad' };
	return { text: 'Calibrated.', grade: jac === undefined ? gradeBelow(null, 1) : gradeOfJac(jac, group.policy.min_jac) };
}
