// @ts-check
/** Links of replays as values: what is said of their times, and which frames show the same. Speeds: 0.25 is four times slow. */

/** @import {InstantPair, LinkedFrames, LinkJson, LinkMap} from '../api/recordings.js' */

/** How fast a replay runs, in words. @param {number} speed */
export function speedText(speed) {
	if (Math.abs(speed - 1) < 0.02) return 'at live speed';
	return speed < 1 ? `${(1 / speed).toFixed(1)} times slower than live` : `${speed.toFixed(1)} times faster than live`;
}

/** A standard deviation with two digits that count. @param {number} sigma */
const sigmaText = (sigma) => sigma.toFixed(sigma > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(sigma)), 1), 6) : 1);

/** Faster than live, times, beyond which hardly any replay runs. */
const FASTEST = 1.4;

/** What is known of the times of a replay, in sentences. @param {LinkMap} map @param {number} fps of the live shot @returns {string[]} */
export function mapText(map, fps) {
	const told = timesText(map, fps);
	if ([map, ...map.pieces].some(({ speed }) => (speed ?? 1) > FASTEST)) told.push('A replay that runs faster than live is unlikely: check the instants and the speed.');
	return map.ball_reason ? [...told, `The times could not be found from the ball. ${map.ball_reason}`] : told;
}

/** @param {LinkMap} map @param {number} fps */
function timesText({ outcome, found_by, reason, speed, speed_sigma, sigma_s, miss_m, pieces, too_close: tooClose }, fps) {
	if (outcome === 'none') return ['Go to the same instant in both, such as a kick or a bounce, and press I.'];
	if (outcome === 'unobservable') return [reason ?? ''];
	const source = found_by === 'ball' ? 'Found from the ball' : 'Found from your instants';
	if (pieces.length) {
		const parts = pieces.map((piece) => `Frames ${piece.first} to ${piece.last} of the replay run ${speedText(piece.speed)} (speed ${piece.speed.toFixed(3)} ± ${sigmaText(piece.speed_sigma)}).`);
		return [`The speed of the replay changes. ${source}.`, ...parts];
	}
	if (outcome === 'offset' && tooClose && reason) return [reason];
	if (outcome === 'offset') return [`One linked instant fixes when the replay starts, but not its speed. The replay is assumed to run ${speedText(speed ?? 1)}.`, 'Link a second instant, as far from the first as you can.'];
	const known = sigma_s === null ? '' : ` Its times are known to ± ${sigmaText(sigma_s * fps)} live frames (one sigma, in the middle of the replay).`;
	const missed = miss_m === null ? '' : ` The rays to the ball miss each other by ${miss_m.toFixed(2)} m.`;
	return [`The replay runs ${speedText(speed ?? 1)} (speed ${(speed ?? 1).toFixed(3)}${speed_sigma === null ? '' : ` ± ${sigmaText(speed_sigma)}`}). ${source}.${known}${missed}`];
}

/** Why a replay cannot follow the live shot; '': it can. @param {LinkJson} link */
export function whyApart({ map, instants }) {
	if (map.outcome === 'linked') return '';
	return map.reason && instants.length > 1 ? map.reason : 'Link two instants first.';
}

/** The frame of the replay that shows what a live frame shows; null outside of the replay. @param {LinkedFrames} frames @param {number} live */
export function replayFrameAt({ first, replay }, live) {
	return replay[live - first] ?? null;
}

/** What is wrong with a frame of a replay, in words, or "". @param {LinkedFrames | null} frames @param {number} frame */
export function markOf(frames, frame) {
	if (frames?.blended.includes(frame)) return 'a mix of two frames';
	return frames?.repeated.includes(frame) ? 'repeats the frame before' : '';
}

/** With one instant more, in place of one that has the same frame of the replay. @template {InstantPair} T @param {T[]} instants @param {InstantPair} one @returns {InstantPair[]} */
export function withInstant(instants, { live, replay }) {
	return [...instants.filter((other) => other.replay !== replay), { live, replay }].sort((a, b) => a.replay - b.replay);
}

/** The nearest instant before (-1) or behind (1) a frame of one side. @template {InstantPair} T @param {T[]} instants @param {'live' | 'replay'} side @param {number} frame @param {1 | -1} way @returns {T | undefined} */
export function instantBeside(instants, side, frame, way) {
	const beyond = instants.filter((one) => Math.sign(one[side] - frame) === way);
	return beyond.sort((a, b) => way * (a[side] - b[side]))[0];
}
