// @ts-check
/** Requests about recordings: their frames, their shots, and the groups that are made of them. */

import { idempotencyKey, queryText, request, requestTagged } from './client.js';

/** @import {ImportSource} from './imports.js' */
/** @import {JobJson} from './jobs.js' */

/**
 * @typedef {object} RecordingJson
 * @property {number} id
 * @property {string} dataset
 * @property {string} name
 * @property {boolean} indexed
 * @property {string | null} sha256 of the file; null until it is indexed
 * @property {number | null} frames
 * @property {number | null} fps
 * @property {boolean | null} variable
 * @property {number | null} seconds
 * @property {number | null} width
 * @property {number | null} height
 * @property {boolean | null} interlaced
 * @property {number | null} damaged pictures that cannot be decoded, and are left out
 * @property {number} shots
 * @property {number} groups
 * @property {string | null} problem
 * @property {string} created
 * @property {MatchClock[]} clocks by frame
 */
/** @typedef {{frame: number, half: number, seconds: number}} MatchClock   what the clock of the match shows in a frame */

/** @typedef {'main' | 'replay' | 'closeup' | 'other'} ShotKind */
/** @typedef {'start' | 'cut' | 'dissolve' | 'wipe' | 'fade'} ShotStart */
/** @typedef {{first: number, last: number, kind: ShotKind, entered_by: ShotStart, kept: boolean | null}} Shot   `kept` null: nobody said */
/** @typedef {Shot & {start_s: number, end_s: number}} TimedShot */

/** @param {AbortSignal} [signal] @returns {Promise<{items: RecordingJson[]}>} */
export function getRecordings(signal) {
	return request('/recordings', { signal });
}

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<RecordingJson>} */
export function getRecording(id, signal) {
	return request(`/recordings/${id}`, { signal });
}

/** @param {{dataset: string, source: ImportSource}} body @returns {Promise<JobJson>} */
export function postRecording(body) {
	return request('/recordings', { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} id @param {{clocks: MatchClock[]}} body @returns {Promise<RecordingJson>} */
export function patchRecording(id, body) {
	return request(`/recordings/${id}`, { method: 'PATCH', body, key: idempotencyKey() });
}

/** @param {number} id */
export function deleteRecording(id) {
	return request(`/recordings/${id}`, { method: 'DELETE' });
}

/** Where a frame is, as wide as it is shown; of another file it is another address, for browsers keep frames. @param {{id: number, sha256: string | null}} recording @param {number} frame @param {number} width pixels */
export function frameAddress({ id, sha256 }, frame, width) {
	return `/api/v1/recordings/${id}/frames/${frame}${queryText({ width, v: sha256?.slice(0, 12) })}`;
}

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<{items: TimedShot[], etag: string}>} */
export function getShots(id, signal) {
	return request(`/recordings/${id}/shots`, { signal });
}

/** @param {number} id @param {Shot[]} shots @param {string} etag @returns {Promise<{items: TimedShot[], etag: string}>} */
export async function putShots(id, shots, etag) {
	const body = { shots: shots.map(({ first, last, kind, entered_by, kept }) => ({ first, last, kind, entered_by, kept })) };
	return (await requestTagged(`/recordings/${id}/shots`, { method: 'PUT', body, etag, key: idempotencyKey() })).json;
}

/** @param {number} id @returns {Promise<JobJson>} */
export function findShots(id) {
	return request(`/recordings/${id}/shots`, { method: 'POST', key: idempotencyKey() });
}

/** @param {number} id @param {number[]} frames @param {{propose: boolean, linked: boolean, dry_run?: boolean}} options whether cameras are proposed afterwards, whether linked replays give views, and whether nothing is kept @returns {Promise<JobJson>} */
export function postInstants(id, frames, options) {
	return request(`/recordings/${id}/groups`, { method: 'POST', body: { frames, ...options }, key: idempotencyKey() });
}

/** @typedef {{recording: number, name: string, first: number, last: number}} LinkedShot */
/** @typedef {{live: number, replay: number}} InstantPair */
/** @typedef {InstantPair & {residual: number | null}} LinkedInstant   `residual`: live frames */
/** @typedef {{first: number, last: number, first_s: number, last_s: number, offset_s: number, speed: number, speed_sigma: number}} LinkPiece */
/**
 * @typedef {object} LinkMap
 * @property {'none' | 'offset' | 'linked' | 'unobservable'} outcome
 * @property {'instants' | 'ball' | null} found_by
 * @property {string | null} reason
 * @property {number | null} speed
 * @property {number | null} speed_sigma
 * @property {number | null} sigma_s
 * @property {number | null} miss_m
 * @property {LinkPiece[]} pieces
 * @property {{frame: number, miss_m: number}[]} misses
 * @property {string | null} ball_reason
 * @property {boolean} turned whether the ball's rays would meet once the replay's cameras are turned by half
 * @property {boolean} too_close whether several instants are too close together to tell the speed
 */
/** @typedef {{id: number, live: LinkedShot, replay: LinkedShot, instants: LinkedInstant[], assumed_speed: number | null, map: LinkMap, etag: string}} LinkJson */
/** @typedef {{first: number, replay: (number | null)[], off_s: (number | null)[], repeated: number[], blended: number[]}} LinkedFrames */
/** @typedef {LinkedShot & {why: string, link: number | null}} LiveSuggestion */

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<{items: LinkJson[]}>} */
export function getLinks(id, signal) {
	return request(`/recordings/${id}/links`, { signal });
}

/** Live shots that the replay at a frame may show. @param {number} id @param {number} frame @param {AbortSignal} [signal] @returns {Promise<{items: LiveSuggestion[]}>} */
export function getLiveSuggestions(id, frame, signal) {
	return request(`/recordings/${id}/links/suggestions/${frame}`, { signal });
}

/** @param {number} id of the recording of the live shot @param {{live: {first: number, last: number}, replay: {recording: number, first: number, last: number}}} body @returns {Promise<LinkJson>} */
export function postLink(id, body) {
	return request(`/recordings/${id}/links`, { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} id @param {number} link @param {AbortSignal} [signal] @returns {Promise<LinkJson>} */
export function getLink(id, link, signal) {
	return request(`/recordings/${id}/links/${link}`, { signal });
}

/** @param {number} id @param {number} link @param {AbortSignal} [signal] @returns {Promise<LinkedFrames>} */
export function getLinkedFrames(id, link, signal) {
	return request(`/recordings/${id}/links/${link}/frames`, { signal });
}

/** @param {number} id @param {number} link @param {{instants: InstantPair[], assumed_speed: number | null}} body @param {string} etag @returns {Promise<LinkJson>} */
export async function putInstants(id, link, { instants, assumed_speed }, etag) {
	const body = { instants: instants.map(({ live, replay }) => ({ live, replay })), assumed_speed };
	return (await requestTagged(`/recordings/${id}/links/${link}/instants`, { method: 'PUT', body, etag, key: idempotencyKey() })).json;
}

/** Find the times of a link from the ball. @param {number} id @param {number} link @param {{live_upload: string | null, replay_upload: string | null}} body @returns {Promise<JobJson>} */
export function postBallLink(id, link, body) {
	return request(`/recordings/${id}/links/${link}/ball`, { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} id @param {number} link */
export function deleteLink(id, link) {
	return request(`/recordings/${id}/links/${link}`, { method: 'DELETE' });
}
