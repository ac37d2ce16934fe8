// @ts-check
/** What the person did last in this window, so that undo takes back that. */

import { stored } from '../lib/storage.js';

/** @typedef {{state: string, reason: string | null, note: string | null}} Before */
/** @typedef {{kind: 'edit', group: number} | {kind: 'verdict', group: number, number: number, before: Before}} Action */

export const lastAction = stored(
	'last-action', /** @type {Action | null} */ (null), 'sessionStorage',
);
