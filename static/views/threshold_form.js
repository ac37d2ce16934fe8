// @ts-check
/** Every threshold of a policy, those of the gates first. */

import { html } from 'htm/preact';

import { Threshold } from './threshold.js';

/** @import {PolicyField, ShippedPolicy, Threshold as Value, Values} from '../api/policies.js' */

/** What is asked when an optional threshold is switched on: what a shipped policy asks, or the middle. @param {PolicyField} field @param {ShippedPolicy[]} shipped @returns {Value} */
function switchedOn(field, shipped) {
	const asked = shipped.map(({ values }) => values[field.name]).find((value) => value !== null && value !== undefined);
	return asked ?? ((field.minimum ?? 0) + (field.maximum ?? 1)) / 2;
}

/**
 * @param {{
 *   fields: PolicyField[], shipped: ShippedPolicy[], present: Values, values: Values,
 *   change: (name: string, value: Value) => void, idle?: string
 * }} props `values` are those that differ from `present`; `idle`: why the thresholds of JaC change nothing
 */
export function ThresholdForm({ fields, shipped, present, values, change, idle = '' }) {
	const source = values['calibration.source'] ?? present['calibration.source'];
	const unread = source === 'paint' ? '' : 'Needs policy "touchline"';
	/** @param {PolicyField} field */
	const one = (field) => html`
		<${Threshold}
			key=${field.name} field=${field} present=${present[field.name] ?? null}
			value=${field.name in values ? values[field.name] : present[field.name] ?? null}
			idle=${field.gate === 'jac' ? idle : field.gate === 'agreement' ? unread : ''} switched=${switchedOn(field, shipped)} change=${(/** @type {Value} */ value) => change(field.name, value)}
		/>`;
	return html`
		${fields.filter(({ gate }) => gate).map(one)}
		<details class="thresholds__rest">
			<summary>Exported 3D ball, findings, noise, pitch and calibration</summary>
			${fields.filter(({ gate }) => !gate).map(one)}
		</details>
	`;
}
