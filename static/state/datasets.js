// @ts-check
/** The datasets, and which of them is meant. */

import { computed, signal } from '@preact/signals';

import { getDatasets } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { pageDataset, param } from '../lib/router.js';
import { stored } from '../lib/storage.js';

/** @import {DatasetJson, PolicyJson} from '../api/types.js' */

/** All datasets; null until they are known. */
export const datasets = signal(/** @type {DatasetJson[] | null} */ (null));

/** Why the list could not be read; null when it could. */
export const failure = signal(/** @type {ApiError | null} */ (null));

const PRACTICE = 'practice';

/** Whether a dataset holds practice groups: everybody's, or (`practice NAME`) those of one person. @param {string} name */
export function isPractice(name) {
	return name === PRACTICE || name.startsWith(`${PRACTICE} `);
}

/** Whether it holds practice groups or (`recording practice`, `recording practice NAME`) a practice recording. @param {string} name */
function isAnyPractice(name) {
	return isPractice(name.replace(/^recording /, ''));
}

const remembered = stored('dataset', '');

/** The dataset of the address bar, else the last one used, else the first. */
export const dataset = computed(() => {
	const all = datasets.value ?? [];
	const named = pageDataset.value || param('dataset');
	if (named) return all.find((one) => one.name === named) ?? null;
	// Nobody is sent to the practice who did not ask for it.
	const first = all.find((one) => !isAnyPractice(one.name)) ?? all[0];
	return all.find((one) => one.name === remembered.value) ?? first ?? null;
});

/** Whether the policy of a dataset finds cameras from paint: then there may be an agreement to show. @param {DatasetJson | null} one */
export function isPainted(one) {
	return one?.policy.calibration?.source === 'paint';
}

/** What is said beside σ where the policy assumes how noisy clicks are; nothing where its dataset's are estimated. @param {PolicyJson | undefined} policy */
export function noiseWords(policy) {
	return policy && policy.noise !== 'estimated' ? 'assumed noise' : '';
}

/** What these words mean. */
export const NOISE_ASSUMED = 'σ is computed from the annotation noise that the policy assumes. The page Statistics shows the noise measured in this dataset; the policy “touchline” uses the measured noise';

/** Read the list again. */
export async function loadDatasets() {
	try {
		datasets.value = (await getDatasets()).items;
		failure.value = null;
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		failure.value = error;
	}
}

/** Mean a dataset, which may have been made since the list was read. @param {string} name */
export function useDataset(name) {
	remembered.value = name;
	if (datasets.value && !datasets.value.some((one) => one.name === name)) loadDatasets();
}
