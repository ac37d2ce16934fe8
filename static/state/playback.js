// @ts-check
/** Playback of a recording: which frame is shown, which way it runs, and the pictures that are on their way. */

import { signal } from '@preact/signals';

import { frameAddress } from '../api/recordings.js';

/** @typedef {{id: number, sha256: string | null, frames: number, fps: number, first?: number, last?: number}} Film   `first` to `last`: what of it is shown, else all */
/** @typedef {ReturnType<typeof makePlayer>} Player */

const AHEAD = 6;
const FASTEST = 8;

/** A player of its own; a page may have several. */
export function makePlayer() {
	/** Number of the frame that is wanted, and of the one that is seen. */
	const wanted = signal(0);
	const seen = signal({ frame: -1, address: '' });
	/** Times the recording's rate; negative: backwards; 0: it stands. */
	const speed = signal(0);
	/** Why no frame is shown. */
	const playTrouble = signal('');
	/** @type {Film} */
	let film = { id: 0, sha256: null, frames: 0, fps: 25 };
	let width = 640;
	/** Counts recordings that were opened: what was on its way for another one is nothing to this one. */
	let turn = 0;
	/** Counts how often it began to run: what ran before ends. */
	let running = 0;
	/** @type {Map<string, HTMLImageElement>} */
	const coming = new Map();
	const first = () => film.first ?? 0;
	const last = () => film.last ?? Math.max(film.frames - 1, 0);

	/** Show a recording from its beginning. @param {Film} next @returns {() => void} ends it */
	function openFilm(next) {
		film = next;
		turn += 1;
		coming.clear();
		speed.value = 0;
		playTrouble.value = '';
		seen.value = { frame: -1, address: '' };
		goTo(first());
		return () => { turn += 1; speed.value = 0; coming.clear(); };
	}

	/** How wide pictures shall be, in the pixels of the screen. @param {number} pixels */
	function showAt(pixels) {
		// Few sizes, so that the browser has most frames already when a window is drawn larger.
		const next = Math.min(1920, Math.max(320, Math.ceil(pixels / 160) * 160));
		if (next === width) return;
		width = next;
		if (film.frames) show(wanted.value);
	}

	/** The picture of a frame, on its way or there. @param {number} frame */
	function pictureOf(frame) {
		const address = frameAddress(film, frame, width);
		let picture = coming.get(address);
		if (!picture) {
			picture = new Image();
			picture.src = address;
			coming.set(address, picture);
			if (coming.size > 4 * AHEAD) coming.delete(coming.keys().next().value ?? '');
		}
		return { address, picture };
	}

	/** Show a frame once it has come, unless another one is wanted by then. @param {number} frame @returns {Promise<boolean>} whether it is shown */
	async function show(frame) {
		const [mine, { address, picture }] = [turn, pictureOf(frame)];
		try {
			await picture.decode();
		} catch {
			coming.delete(address);
			if (mine === turn && wanted.value === frame) {
				speed.value = 0;
				playTrouble.value = `Frame ${frame} cannot be shown now.`;
			}
			return false;
		}
		if (mine !== turn || wanted.value !== frame) return false;
		playTrouble.value = '';
		seen.value = { frame, address };
		const way = Math.sign(speed.value) || 1;
		for (let step = 1; step <= (speed.value ? AHEAD : 1); step += 1) {
			const next = frame + way * step * Math.max(1, Math.abs(speed.value));
			if (next >= first() && next <= last()) pictureOf(next);
		}
		return true;
	}

	/** Go to a frame, as near as there is one. @param {number} frame */
	function goTo(frame) {
		wanted.value = Math.min(Math.max(Math.round(frame), first()), last());
		return show(wanted.value);
	}

	/** Stand, and go some frames on or back. @param {number} frames */
	function stepBy(frames) {
		speed.value = 0;
		return goTo(wanted.value + frames);
	}

	/** Run forwards (1) or backwards (-1): again, twice as fast. @param {1 | -1} way */
	function run(way) {
		const present = speed.value;
		const next = Math.sign(present) === way ? Math.min(2 * Math.abs(present), FASTEST) * way : way;
		speed.value = next;
		if (present === 0) play();
	}

	/** Stand still. */
	function stand() {
		speed.value = 0;
	}

	/** Run, or stand. */
	function toggleRunning() {
		if (speed.value) stand();
		else run(1);
	}

	async function play() {
		running += 1;
		const mine = running;
		while (speed.value && mine === running) {
			const began = performance.now();
			const next = wanted.value + speed.value;
			if (next < first() || next > last()) {
				speed.value = 0;
				return;
			}
			await goTo(next);
			const rest = began + 1000 / film.fps - performance.now();
			if (rest > 0) await new Promise((resolve) => { setTimeout(resolve, rest); });
		}
	}

	return { wanted, seen, speed, playTrouble, openFilm, showAt, goTo, stepBy, run, stand, toggleRunning };
}

/** The player of the page of a recording. */
export const { wanted, seen, speed, playTrouble, openFilm, showAt, goTo, stepBy, run, stand, toggleRunning } = makePlayer();
