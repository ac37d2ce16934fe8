// @ts-check
/** The gates in words: what each asks, and what it means when it fails. */

/** @import {GateJson, PolicyJson} from '../api/types.js' */

/** What is wrong when the gate fails. */
export const GATE_TITLES = /** @type {Record<string, string>} */ ({
	calibratable: 'Too few views have a camera',
	jac: 'Field lines do not fit',
	two_views: 'Fewer than two views are left',
	ball: 'The ball is drawn in fewer than two views',
	baseline: 'The cameras stand in one place',
	reprojection: 'The views do not agree on one ball',
	parallax: 'The rays are nearly parallel',
	sigma: 'The position is too uncertain',
});

/** @param {GateJson} gate @param {PolicyJson} policy @returns {string} what the gate asks */
export function gateLabel(gate, policy) {
	const { threshold } = gate;
	const labels = /** @type {Record<string, string>} */ ({
		calibratable: 'Cameras found',
		jac: `JaC ${policy.jac_gamma_percent} % > ${policy.min_jac}`,
		two_views: 'At least 2 views left',
		ball: 'Ball in ≥ 2 views',
		baseline: `Baseline ≥ ${policy.min_baseline_m} m`,
		reprojection: `Reprojection < ${policy.tau_percent} %`,
		parallax: threshold === null ? 'Parallax' : `Parallax ≥ ${threshold}°`,
		sigma: threshold === null ? 'σ' : `σ ≤ ${threshold} m`,
	});
	return labels[gate.name] ?? gate.name;
}

const UNITS = /** @type {Record<string, [number, string]>} */ ({
	jac: [2, ''], baseline: [1, ' m'], reprojection: [1, ' px'], parallax: [1, '°'], sigma: [2, ' m'],
});

/** How far the value is from its threshold, or "". @param {GateJson} gate */
export function gateMargin(gate) {
	const unit = UNITS[gate.name];
	if (!unit || gate.margin === null || !gate.active) return '';
	const size = Math.abs(gate.margin).toFixed(unit[0]);
	// A gate may ask for more than its threshold.
	if (!gate.passed && Number(size) === 0) return 'at the threshold: more is asked';
	return `margin ${gate.margin < 0 ? '−' : '+'}${size}${unit[1]}`;
}
