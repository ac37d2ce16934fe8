// @ts-check
/** Requests about cameras over time: a camera for each frame of a shot of a recording. */

import { idempotencyKey, queryText, request } from './client.js';

/** @import {JobJson} from './jobs.js' */
/** @import {PitchSizeJson} from './match_estimates.js' */

/**
 * @typedef {object} ShownPitchJson
 * @property {number | null} length metres; null where it is not shown, like width
 * @property {number | null} width
 * @property {{length: number | null, width: number | null}} sigma standard deviations
 * @property {number} frames it rests on
 * @property {PitchSizeJson | null} other the size, where it certainly is not that of the match
 */

/**
 * What became of the frames of a shot.
 *
 * @typedef {object} CameraSummary
 * @property {number} frames
 * @property {number} tracked the camera lies on the paint
 * @property {number} bridged the background carries the camera
 * @property {number} lost no camera
 * @property {number | null} worst_frame tracked frame whose paint lies farthest from its markings
 * @property {number | null} worst_px
 * @property {number[]} annotated frames whose lines were known
 * @property {number[]} unusable frames with too few lines
 * @property {boolean} turned whether a person turned them by half a turn of the pitch
 * @property {ShownPitchJson | null} pitch that its frames show together
 */
/**
 * @typedef {object} ShotCamerasJson
 * @property {number} id
 * @property {number} first
 * @property {number} last
 * @property {CameraSummary} summary
 * @property {CameraSummary | null} before of the cameras that these took the place of
 * @property {number} revision
 * @property {boolean} stale whether the video is another one by now
 * @property {number[]} drawn frames with lines now
 * @property {string} created
 * @property {string} by
 */
/**
 * Columns: the same place is the same frame.
 *
 * @typedef {object} FrameCamerasJson
 * @property {number} first
 * @property {number} last
 * @property {[number, number]} size of a frame, pixels
 * @property {[number, number] | null} principal_point
 * @property {[number, number]} pitch length and width of the pitch of the match, metres
 * @property {string} outcome a letter a frame: T, B, L
 * @property {number[]} time
 * @property {(number | null)[]} supported
 * @property {(number | null)[]} explained
 * @property {(number | null)[]} error_px
 * @property {number[]} keyframe
 * @property {(string | null)[]} reason
 * @property {(number[] | null)[]} camera x, y, z (m); pan, tilt, roll (degrees); focal lengths (px); k1
 * @property {(number[] | null)[]} sigma position, pan, tilt, roll, focal length
 */

/** @param {number} id of the recording @param {AbortSignal} [signal] @returns {Promise<{items: ShotCamerasJson[]}>} */
export function getCameraStretches(id, signal) {
	return request(`/recordings/${id}/cameras`, { signal });
}

/** The cameras of the stretch that has a frame. @param {number} id @param {number} frame @param {boolean} before those that the present ones took the place of @param {AbortSignal} [signal] @returns {Promise<FrameCamerasJson>} */
export function getFrameCameras(id, frame, before, signal) {
	return request(`/recordings/${id}/cameras/${frame}${queryText({ before: before ? 'true' : null })}`, { signal });
}

/** @param {number} id @param {{first: number, last: number}} stretch @returns {Promise<JobJson>} */
export function postCameras(id, { first, last }) {
	return request(`/recordings/${id}/cameras`, { method: 'POST', body: { first, last }, key: idempotencyKey() });
}

/** Turn the cameras of the stretch that has a frame by half a turn of the pitch, or back. @param {number} id @param {number} frame @param {boolean} turned against what the tracker gave @returns {Promise<JobJson>} */
export function turnCameras(id, frame, turned) {
	return request(`/recordings/${id}/cameras/${frame}`, { method: 'PATCH', body: { turned }, key: idempotencyKey() });
}

/** Where the cameras of a stretch are as a file of another tool. @param {number} id @param {number} frame @param {string} format */
export function camerasFile(id, frame, format) {
	return `/api/v1/recordings/${id}/cameras/${frame}/file${queryText({ format })}`;
}
