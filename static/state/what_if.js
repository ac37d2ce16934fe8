// @ts-check
/** Other thresholds tried out: what they would let through, as fast as they are moved. */

import { useEffect, useMemo, useRef, useState } from 'preact/hooks';

import { askYield } from '../api/policies.js';
import { ApiError } from '../api/problem.js';
import { latest } from '../lib/latest.js';

/** @import {Values, YieldJson} from '../api/policies.js' */

/** One frame: the newest position of a slider is asked for, the ones before it are not. */
const PAUSE = 16;
/** Milliseconds until it is asked again where the groups are still being counted. */
const GATHERING = 2000;

/** Thresholds as parameters of an address. @param {Values} values */
export function textsOf(values) {
	return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, JSON.stringify(value)]));
}

/** The thresholds of an address that differ from those of the saved policy; what cannot be read is left out. @param {URLSearchParams} search @param {Values} present @returns {Values} */
export function valuesIn(search, present) {
	/** @type {Values} */
	const values = {};
	for (const [name, text] of search) {
		try {
			const value = JSON.parse(text);
			if (name in present && value !== present[name]) values[name] = value;
		} catch {
			// Somebody wrote it by hand.
		}
	}
	return values;
}

/**
 * The yield of the thresholds that are on screen; the last answer stays until the next.
 *
 * @param {number} dataset @param {Values} values those that differ from the saved policy
 * @param {string} hash of the saved policy
 * @returns {{answer: YieldJson | null, error: ApiError | null}}
 */
export function useWhatIf(dataset, values, hash) {
	const [state, setState] = useState(/** @type {{answer: YieldJson | null, error: ApiError | null}} */ ({ answer: null, error: null }));
	const again = useRef(/** @type {ReturnType<typeof setTimeout> | undefined} */ (undefined));
	const asking = useMemo(() => latest(PAUSE, async (/** @type {Values} */ asked, signal) => {
		try {
			const answer = await askYield(dataset, asked, signal);
			if (!signal.aborted) setState({ answer, error: null });
		} catch (error) {
			if (signal.aborted) return;
			if (!(error instanceof ApiError)) throw error;
			setState((before) => ({ ...before, error }));
			// So many groups have changed that they are counted first; the sentence says how far it is.
			if (error.status === 503) again.current = setTimeout(() => asking.run(asked), GATHERING);
		}
	}), [dataset]);
	useEffect(() => { clearTimeout(again.current); asking.run(values); }, [asking, values, hash]);
	useEffect(() => () => { clearTimeout(again.current); asking.cancel(); }, [asking]);
	return state;
}
