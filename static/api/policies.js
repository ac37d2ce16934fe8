// @ts-check
/** Requests about the thresholds of a dataset and what they let through. */

import { idempotencyKey, request, requestTagged } from './client.js';

/** @import {JobJson} from './jobs.js' */

/** @typedef {number | boolean | string | null} Threshold */
/** @typedef {{[name: string]: Threshold}} Values   names of the calibration's part are dotted */

/**
 * @typedef {object} PolicyField
 * @property {string} name
 * @property {string} label
 * @property {string} unit
 * @property {Threshold} default null: nothing is asked
 * @property {number | null} minimum
 * @property {number | null} maximum
 * @property {(number | string)[]} choices values to offer; empty: any between the ends
 * @property {string | null} gate
 * @property {string | null} comparison how a value compares with it to pass: "more than", "at least", "at most"
 * @property {boolean} optional whether it can be null
 */

/** @typedef {{version: number, name: string, hash: string, at: string, actor: string}} PolicyChange */

/**
 * @typedef {object} PolicyState
 * @property {string} name
 * @property {string} hash
 * @property {number} version
 * @property {Values} values
 * @property {string} yaml
 * @property {PolicyChange[]} history
 */

/** @typedef {{name: string, hash: string, values: Values}} ShippedPolicy */
/** @typedef {{gate: string, label: string, left: number, dropped: number}} FunnelStep */
/** @typedef {{gamma_percent: number, thresholds: number[], groups: number[]}} YieldCurve */

/**
 * @typedef {object} YieldJson
 * @property {any} policy the one that is judged by
 * @property {number} groups
 * @property {number} passing
 * @property {FunnelStep[]} funnel
 * @property {number} unsolved
 * @property {number} given_not_measured
 * @property {YieldCurve[]} curves
 * @property {{split: string, groups: number, passing: number}[]} splits
 * @property {{from: number | null, to: number | null, groups: number, passing: number}[]} distances
 * @property {{match: string, splits: any}[]} leakage
 * @property {number} gained
 * @property {number} lost
 * @property {string[]} [needs_solving]
 */

/** The calibration's part is nested in JSON. @param {any} values @returns {Values} */
function flattened({ calibration = {}, ...rest }) {
	const inner = Object.entries(calibration).map(([name, value]) => [`calibration.${name}`, value]);
	return { ...rest, ...Object.fromEntries(inner) };
}

/** @param {Values} values */
function nested(values) {
	/** @type {{[name: string]: any}} */
	const body = {};
	for (const [name, value] of Object.entries(values)) {
		const inner = name.startsWith('calibration.') ? name.slice('calibration.'.length) : null;
		if (inner) body.calibration = { ...body.calibration, [inner]: value };
		else body[name] = value;
	}
	return body;
}

/** @param {AbortSignal} [signal] @returns {Promise<{items: ShippedPolicy[], fields: PolicyField[]}>} */
export async function getPolicies(signal) {
	const answer = await request('/policies', { signal });
	return { ...answer, items: answer.items.map((/** @type {any} */ item) => ({ ...item, values: flattened(item.values) })) };
}

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{policy: PolicyState, etag: string}>} */
export async function getPolicy(dataset, signal) {
	const { json, etag } = await requestTagged(`/datasets/${dataset}/policy`, { signal });
	return { policy: { ...json, values: flattened(json.values) }, etag };
}

/** Judge by other thresholds, or by a shipped policy. @param {number} dataset @param {string} name @param {Values | null} values null: the shipped policy of that name @param {string} etag @returns {Promise<JobJson>} */
export function putPolicy(dataset, name, values, etag) {
	const body = values ? { name, values: nested(values) } : { name };
	return request(`/datasets/${dataset}/policy`, { method: 'PUT', body, etag, key: idempotencyKey() });
}

/** @param {number} dataset @param {string} yaml @param {string} etag @returns {Promise<JobJson>} */
export function putPolicyText(dataset, yaml, etag) {
	return request(`/datasets/${dataset}/policy`, { method: 'PUT', body: { yaml }, etag, key: idempotencyKey() });
}

/** What other thresholds would let through; saves nothing. @param {number} dataset @param {Values} values @param {AbortSignal} [signal] @returns {Promise<YieldJson>} */
export function askYield(dataset, values, signal) {
	return request(`/datasets/${dataset}/yield`, { method: 'POST', body: nested(values), signal });
}
