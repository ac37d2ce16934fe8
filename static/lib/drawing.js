// @ts-check
/** Drawing with the next frame, once for all that ask for it until then. */

/**
 * @param {() => void} work
 * @returns {{ask: () => void, cancel: () => void}} `cancel`: forget what was asked for
 */
export function nextFrame(work) {
	/** @type {number | null} */
	let coming = null;
	return {
		ask() {
			coming ??= requestAnimationFrame(() => {
				coming = null;
				work();
			});
		},
		cancel() {
			if (coming !== null) cancelAnimationFrame(coming);
			coming = null;
		},
	};
}
