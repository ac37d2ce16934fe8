// @ts-check
/** Work that is asked for faster than it can be done: the newest request wins. */

/**
 * A function that runs `work` at most every `interval` milliseconds and never twice at once;
 * of the calls in between only the last one is run.
 *
 * @template T
 * @param {number} interval
 * @param {(value: T, signal: AbortSignal) => Promise<void>} work
 * @returns {{run: (value: T) => void, cancel: () => void}}
 */
export function latest(interval, work) {
	/** @type {{value: T} | null} */
	let waiting = null;
	let running = false;
	let last = -Infinity;
	let controller = new AbortController();
	/** @type {ReturnType<typeof setTimeout> | undefined} */
	let timer;

	async function start() {
		timer = undefined;
		if (!waiting || running) return;
		const { value } = waiting;
		waiting = null;
		running = true;
		last = performance.now();
		const { signal } = controller;
		try {
			await work(value, signal);
		} catch (error) {
			if (!signal.aborted) throw error;
		} finally {
			running = false;
			schedule();
		}
	}

	function schedule() {
		if (!waiting || running || timer !== undefined) return;
		timer = setTimeout(start, Math.max(0, last + interval - performance.now()));
	}

	return {
		run(value) {
			waiting = { value };
			schedule();
		},
		cancel() {
			waiting = null;
			clearTimeout(timer);
			timer = undefined;
			controller.abort();
			controller = new AbortController();
		},
	};
}
