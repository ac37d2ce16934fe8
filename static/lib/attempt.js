// @ts-check
/** What somebody asks of the server: under way, done, or refused with a reason. */

import { useState } from 'preact/hooks';

import { ApiError } from '../api/problem.js';

/**
 * @typedef {object} Attempt
 * @property {ApiError | null} error why the last one was refused
 * @property {boolean} busy
 * @property {<T>(doing: Promise<T>, then?: (done: T) => void) => Promise<boolean>} attempt
 *   whether it was done, after `then`
 */

/** Ask for things, one after the other. @returns {Attempt} */
export function useAttempt() {
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	const [busy, setBusy] = useState(false);
	return {
		error, busy,
		attempt: async (doing, then = () => {}) => {
			setBusy(true);
			// Gone first, so that the same sentence is said again.
			setError(null);
			try {
				then(await doing);
				return true;
			} catch (refused) {
				if (!(refused instanceof ApiError)) throw refused;
				setError(refused);
				return false;
			} finally {
				setBusy(false);
			}
		},
	};
}
