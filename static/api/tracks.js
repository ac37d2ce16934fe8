// @ts-check
/** Requests about tracks of the ball: listed, made, looked at frame by frame, judged. */

import { idempotencyKey, queryText, request, requestTagged } from './client.js';

/** @import {JobJson} from './jobs.js' */

/** @typedef {'kick' | 'bounce' | 'out'} EventKind */
/** @typedef {'measured' | 'one_view' | 'predicted' | 'bridged' | 'gap'} BallState */
/** @typedef {'roll' | 'flight' | 'held' | 'out' | ''} BallMode */
/** @typedef {{frame: number, kind: EventKind, added: boolean}} Correction   `added` false: it did not happen */
/**
 * @typedef {object} TrackSummary
 * @property {number} frames
 * @property {Record<string, number>} states
 * @property {Record<string, number>} events
 * @property {number} measurements
 * @property {number} contradicted
 * @property {number | null} median_px
 * @property {number | null} p95_px
 * @property {number | null} worst
 * @property {string | null} reason
 * @property {number} rate
 * @property {Record<string, number>} unused
 * @property {Record<string, number>} noise times that balls of a camera are noisier than clicks because it is inexact
 * @property {Record<string, number>} late seconds to add to the times of a camera
 */
/**
 * @typedef {object} TrackJson
 * @property {number} id
 * @property {string} dataset
 * @property {string} key
 * @property {string} match
 * @property {number} first
 * @property {number} last
 * @property {boolean} stale
 * @property {'accepted' | 'rejected' | null} verdict
 * @property {string | null} note
 * @property {string | null} judged_by
 * @property {Correction[]} corrections
 * @property {TrackSummary} summary
 * @property {string} created
 * @property {string} etag
 */
/** @typedef {{frame: number, time_s: number, kind: EventKind, position: number[], sigma_s: number, added: boolean}} TrackEvent */
/** @typedef {{frame: number, view: string, group: number | null, x: number, y: number, track_x: number | null, track_y: number | null, px: number, sentence: string, fix: string}} Contradiction */
/** @typedef {{frame: number, time_s: number, metres: number, views: string[]}} TrackJump where other views take over and put the ball elsewhere */
/**
 * @typedef {object} TrackFrames
 * @property {number[]} frame
 * @property {number[]} time_s
 * @property {(number | null)[]} x
 * @property {(number | null)[]} y
 * @property {(number | null)[]} z
 * @property {(number | null)[]} sigma
 * @property {(number[] | null)[]} covariance xx, xy, xz, yy, yz, zz
 * @property {(number[] | null)[]} velocity
 * @property {BallState[]} state
 * @property {BallMode[]} mode
 * @property {string[][]} views
 * @property {(number | null)[]} left_out_px
 * @property {(number[] | null)[]} raw where the views of a frame alone put the ball
 * @property {(number | null)[]} group
 * @property {TrackJump[]} jumps
 * @property {TrackEvent[]} events
 * @property {Contradiction[]} contradicted
 */

/** @typedef {TrackJson & {batches: number[], assigned: string[]}} ListedTrackJson   open batches that it is in, and whom these are given to */
/** @typedef {{verdict?: 'accepted' | 'rejected' | 'none', stale?: boolean, assigned?: string, batch?: number, sort?: 'match' | 'worst' | 'gaps'}} TrackChoice */

/** @typedef {TrackFrames & {reason: string | null}} TrackAround   why no track comes of these frames */

/** @param {string} dataset @param {TrackChoice} [choice] @param {AbortSignal} [signal] @returns {Promise<{items: ListedTrackJson[]}>} */
export function getTracks(dataset, choice = {}, signal = undefined) {
	return request(`/datasets/${encodeURIComponent(dataset)}/tracks${queryText(choice)}`, { signal });
}

/** @param {string} dataset @returns {Promise<JobJson>} */
export function postTracks(dataset) {
	return request(`/datasets/${encodeURIComponent(dataset)}/tracks`, { method: 'POST', body: {}, key: idempotencyKey() });
}

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<TrackJson>} */
export function getTrack(id, signal) {
	return request(`/tracks/${id}`, { signal });
}

/** @param {number} id @param {number} first @param {AbortSignal} [signal] @returns {Promise<TrackFrames>} */
export function getTrackFrames(id, first, signal) {
	return request(`/tracks/${id}/frames${queryText({ first })}`, { signal });
}

/** The tracks that a group is in, and its frame there. @param {number} group @param {AbortSignal} [signal] @returns {Promise<{items: {track: TrackJson, frame: number}[]}>} */
export function getTracksOfGroup(group, signal) {
	return request(`/groups/${group}/tracks`, { signal });
}

/** The frames around one as they come out of the groups as they are now. @param {number} id @param {number} frame @param {AbortSignal} [signal] @returns {Promise<TrackAround>} */
export function getTrackAround(id, frame, signal) {
	return request(`/tracks/${id}/around${queryText({ frame })}`, { signal });
}

/** @param {TrackJson} track @param {{verdict?: 'accepted' | 'rejected' | 'none', note?: string, corrections?: Correction[]}} body @returns {Promise<TrackJson>} */
export async function patchTrack({ id, etag }, body) {
	return (await requestTagged(`/tracks/${id}`, { method: 'PATCH', body, etag, key: idempotencyKey() })).json;
}
