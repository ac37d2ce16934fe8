// @ts-check
/** Where the calibration editor of a view is found. */

import { address } from '../lib/router.js';
import { query } from './navigation.js';

/** @param {number} group @param {string} view key @returns {string} */
export function editorAddress(group, view) {
	return address(`/review/${group}/calibration`, { view, q: query.value });
}
