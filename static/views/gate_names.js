// @ts-check
/** The gates in words: what each asks, and what it means when it fails. */

import { sharePercent } from '../lib/format.js';

/** @import {GateJson, PolicyJson} from '../api/types.js' */

/** Gates that count views: their sentence says how many there are, and no margin does. */
export const COUNTED = new Set(['calibratable', 'two_views', 'ball']);

/** Whether nothing could be compared. A sigma that is not known has no number either, and fails. @param {GateJson} gate */
export function isUnjudged({ value, passed, sentence }) {
	return value === null && (passed || sentence.startsWith('not judged'));
}

/** What is wrong when the gate fails. */
export const GATE_TITLES = /** @type {Record<string, string>} */ ({
	calibratable: 'Too few views have a camera',
	jac: 'Field lines do not fit',
	agreement: 'The paint contradicts the cameras',
	two_views: 'Fewer than two views are usable',
	ball: 'The ball is drawn in fewer than two views',
	baseline: 'The cameras stand too close together',
	reprojection: 'The views do not agree on one ball',
	parallax: 'The rays are nearly parallel',
	sigma: 'The position is too uncertain',
	chi_square: 'The views contradict each other',
});

/** @param {GateJson} gate @param {PolicyJson} policy @returns {string} what the gate asks */
export function gateLabel(gate, policy) {
	const { threshold } = gate;
	const labels = /** @type {Record<string, string>} */ ({
		calibratable: 'Cameras found',
		jac: `JaC ${policy.jac_gamma_percent} % > ${policy.min_jac}`,
		agreement: threshold === null ? 'Agreement with the paint' : `Agreement with the paint ≥ ${threshold}`,
		two_views: 'At least 2 usable views',
		ball: 'Ball in ≥ 2 views',
		baseline: `Baseline ≥ ${policy.min_baseline_m} m`,
		reprojection: `Reprojection ≤ ${policy.tau_percent} %`,
		parallax: threshold === null ? 'Parallax' : `Parallax ≥ ${threshold}°`,
		sigma: threshold === null ? 'σ' : `σ ≤ ${threshold} m`,
		chi_square: threshold === null ? 'Consistency' : `Consistency p ≥ ${threshold}`,
	});
	return labels[gate.name] ?? gate.name;
}

/** How far the value is from its threshold, as a share of the threshold, or "" where views are counted. @param {GateJson} gate */
export function gateMargin(gate) {
	const { margin, passed, active, name } = gate;
	if (margin === null || !active || COUNTED.has(name)) return '';
	const size = sharePercent(margin);
	// A gate may ask for more than its threshold.
	if (size === '0.0 %') return passed ? 'equals the threshold' : 'equals the threshold; must be above it';
	return margin < 0 ? `misses by ${size}` : `margin ${size.startsWith('over') ? '' : '+'}${size}`;
}
