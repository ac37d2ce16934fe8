// @ts-check
/** The ball of a track at a frame, as the 3D view and the plan show it. */

import { ellipsoidOf } from '../../geometry/ellipsoid.js';

/** @import {TrackFrames} from '../../api/tracks.js' */
/** @import {PitchPoint} from '../../geometry/camera.js' */
/** @import {SceneValues, Stand} from './values.js' */

/** Standard deviations of the ellipsoid. */
const DEVIATIONS = 2;

/** Where the ball is at a place of the columns; null in gaps. @param {TrackFrames} frames @param {number} place @returns {PitchPoint | null} */
export function pointAt({ x, y, z }, place) {
	const point = [x[place], y[place], z[place]];
	return point.every((value) => typeof value === 'number') ? /** @type {PitchPoint} */ (point) : null;
}

/** Where the ball came from in the frames before a place, two points for each piece. @param {TrackFrames} frames @param {number} place @param {number} count of frames @returns {PitchPoint[]} */
export function trailOf(frames, place, count) {
	/** @type {PitchPoint[]} */
	const pieces = [];
	for (let i = Math.max(place - count, 0); i < place; i += 1) {
		const [from, to] = [pointAt(frames, i), pointAt(frames, i + 1)];
		if (from && to) pieces.push(from, to);
	}
	return pieces;
}

/**
 * Letters of the cameras that see the ball: a rig's tracks call views by their keys. Those of a recording have names
 * of their own, the main camera's without a link, and replays stand behind it.
 *
 * @param {Pick<Stand, 'key' | 'letter'>[]} stands @param {string[]} names @returns {Set<string>}
 */
export function lettersOf(stands, names) {
	const linked = names.filter((name) => / link \d+$/.test(name)).length;
	const own = names.length > linked;
	const found = stands.filter(({ key }, i) => names.includes(key) || (i === 0 ? own && !stands.some((one) => names.includes(one.key)) : i <= linked));
	return new Set(found.map(({ letter }) => letter));
}

/**
 * Cameras under the names that the track gives its views, where it calls them by their keys.
 *
 * @template {Pick<Stand, 'key' | 'label'>} T
 * @param {T[]} stands @param {Pick<TrackFrames, 'views'>} frames @returns {T[]}
 */
export function withTrackNames(stands, { views }) {
	const names = new Set(views.flat());
	return stands.some(({ key }) => names.has(key)) ? stands.map((stand) => ({ ...stand, label: stand.key })) : stands;
}

/**
 * What the 3D view shows of a track at a place of its columns.
 *
 * @param {Pick<SceneValues, 'pitch' | 'stands' | 'diameter'>} base @param {TrackFrames} frames @param {number} place
 * @param {number} rate frames a second: the trail is of the last one
 * @returns {SceneValues}
 */
export function trackScene(base, frames, place, rate) {
	const [point, spread] = [pointAt(frames, place), frames.covariance[place]];
	const [xx, xy, xz, yy, yz, zz] = spread ?? [];
	return {
		...base, pairs: [], ball: null,
		best: point && { point, height: -point[2], sigma: frames.sigma[place], ellipsoid: ellipsoidOf(spread ? [xx, xy, xz, xy, yy, yz, xz, yz, zz] : [], DEVIATIONS) },
		seen: lettersOf(base.stands, frames.views[place]),
		trail: trailOf(frames, place, Math.round(rate)),
	};
}
