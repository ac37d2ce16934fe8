// @ts-check
/** What a page reads from the server: waiting, there, or refused with a reason. */

import { useCallback, useEffect, useState } from 'preact/hooks';

import { ApiError } from '../api/problem.js';

/**
 * @template T
 * @typedef {object} Resource
 * @property {T | null} value the last answer; stays while a newer one is awaited
 * @property {ApiError | null} error why there is none
 * @property {boolean} waiting
 * @property {() => void} reload
 */

/**
 * Read something, again whenever what it depends on changes.
 *
 * @template T
 * @param {(signal: AbortSignal) => Promise<T | null>} read
 * @param {readonly unknown[]} inputs
 * @returns {Resource<T>}
 */
export function useResource(read, inputs) {
	const [turn, setTurn] = useState(0);
	const asked = [...inputs, turn];
	const [state, setState] = useState(
		/** @type {{value: T | null, error: ApiError | null, asked: readonly unknown[]}} */
		({ value: null, error: null, asked: [] }),
	);
	useEffect(() => {
		const controller = new AbortController();
		const { signal } = controller;
		read(signal).then(
			(value) => { if (!signal.aborted) setState({ value, error: null, asked }); },
			(error) => {
				if (signal.aborted) return;
				if (!(error instanceof ApiError)) throw error;
				setState({ value: null, error, asked });
			},
		);
		return () => controller.abort();
	}, asked);
	const { value, error } = state;
	// Told from the first drawing on: whoever acts upon an answer must not take the last one's for it.
	const waiting = asked.length !== state.asked.length || asked.some((one, index) => !Object.is(one, state.asked[index]));
	return { value, error, waiting, reload: useCallback(() => setTurn((n) => n + 1), []) };
}
