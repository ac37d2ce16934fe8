// @ts-check
/** Plays a track: which frame is at hand, which way it runs and how fast. */

import { computed, signal } from '@preact/signals';

/** @typedef {{first: number, last: number, rate: number}} Stretch   frames, and how many a second */
/** @typedef {{ask: (run: (now: number) => void) => void, calm: () => boolean}} Clock   `ask`: call at the next picture; `calm`: little shall move */
/** @typedef {ReturnType<typeof makeTrackPlayer>} TrackPlayer */

/** Times the rate of the track that people choose from. */
export const PACES = [0.1, 0.25, 0.5, 1, 2, 4];
const FASTEST = 8;
/** How long a picture stands where little shall move, milliseconds. */
const CALM_MS = 500;

/** @type {Clock} */
const BROWSER = {
	ask: (run) => { requestAnimationFrame(run); },
	calm: () => matchMedia('(prefers-reduced-motion: reduce)').matches,
};

/** A player of a track. @param {Stretch} stretch @param {Clock} [clock] */
export function makeTrackPlayer({ first, last, rate }, clock = BROWSER) {
	/** The frame at hand. */
	const at = signal(first);
	/** How fast it runs when it runs. */
	const pace = signal(1);
	const run = signal({ way: 0, times: 1 });
	/** Times the rate of the track; negative: backwards; 0: it stands. */
	const speed = computed(() => run.value.way * Math.min(FASTEST, pace.value * run.value.times));
	/** From when and where it has run at its speed. @type {{now: number, frame: number} | null} */
	let since = null;
	let turn = 0;

	/** Go to a frame, as near as there is one. @param {number} frame */
	function goTo(frame) {
		at.value = Math.min(Math.max(Math.round(frame), first), last);
		since = null;
	}

	/** Stand, and go some frames on or back. @param {number} frames */
	function stepBy(frames) {
		stand();
		goTo(at.value + frames);
	}

	/** @param {number} mine */
	function play(mine) {
		clock.ask((now) => {
			if (mine !== turn || speed.value === 0) return;
			since ??= { now, frame: at.value };
			const passed = now - since.now;
			const shown = clock.calm() ? passed - (passed % CALM_MS) : passed;
			const wanted = since.frame + Math.trunc((shown / 1000) * rate * speed.value);
			at.value = Math.min(Math.max(wanted, first), last);
			if (wanted <= first && speed.value < 0 || wanted >= last && speed.value > 0) stand();
			else play(mine);
		});
	}

	/** Run forwards (1) or backwards (-1): again, twice as fast. @param {1 | -1} way */
	function runBy(way) {
		const present = run.value;
		since = null;
		if (present.way === way) {
			run.value = { way, times: 2 * present.times };
			return;
		}
		// At its end it begins anew.
		if (present.way === 0 && at.value === (way > 0 ? last : first)) at.value = way > 0 ? first : last;
		run.value = { way, times: 1 };
		turn += 1;
		play(turn);
	}

	/** Stand still. */
	function stand() {
		turn += 1;
		since = null;
		if (run.value.way) run.value = { way: 0, times: 1 };
	}

	/** Run, or stand. */
	function toggle() {
		if (run.value.way) stand();
		else runBy(1);
	}

	/** Run faster or slower from now on. @param {number} next one of `PACES` */
	function setPace(next) {
		pace.value = next;
		since = null;
	}

	/** The next pace. @param {1 | -1} way */
	function changePace(way) {
		const place = PACES.indexOf(pace.value) + way;
		if (place >= 0 && place < PACES.length) setPace(PACES[place]);
	}

	return { at, speed, pace, goTo, stepBy, run: runBy, stand, toggle, setPace, changePace };
}
