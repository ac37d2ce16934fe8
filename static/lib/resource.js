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
	const [state, setState] = useState(
		/** @type {{value: T | null, error: ApiError | null, waiting: boolean}} */
		({ value: null, error: null, waiting: true }),
	);
	const [turn, setTurn] = useState(0);
	useEffect(() => {
		const controller = new AbortController();
		const { signal } = controller;
		setState((before) => ({ ...before, waiting: true }));
		read(signal).then(
			(value) => { if (!signal.aborted) setState({ value, error: null, waiting: false }); },
			(error) => {
				if (signal.aborted) return;
				if (!(error instanceof ApiError)) throw error;
				setState({ value: null, error, waiting: false });
			},
		);
		return () => controller.abort();
	}, [...inputs, turn]);
	return { ...state, reload: useCallback(() => setTurn((n) => n + 1), []) };
}
