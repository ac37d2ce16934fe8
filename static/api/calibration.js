// @ts-check
/** Requests of the calibration editor. */

import { idempotencyKey, request } from './client.js';
import { ApiError } from './problem.js';

/** @import {GroupDocument, LinesJson, ViewJson} from './types.js' */

/**
 * @typedef {object} StationDetail
 * @property {number} id
 * @property {string} key
 * @property {number} groups how many groups it takes part in
 * @property {LinesJson} lines
 * @property {'given' | 'lines'} calibration
 * @property {boolean} has_given
 * @property {boolean} has_given_covariance an accepted rig, or the data, says how far it may be off
 * @property {boolean} can_undo
 * @property {boolean} can_redo
 * @property {string} etag
 */
/**
 * @typedef {object} InfluenceJson
 * @property {string} marking
 * @property {{[gamma: string]: number} | null} jac
 * @property {{[gamma: string]: number} | null} jac_without
 * @property {number | null} largest_px
 * @property {number | null} largest_px_without
 */
/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<StationDetail>} */
export function getStation(id, signal) {
	return request(`/stations/${id}`, { signal });
}

/**
 * What the camera would be without each of its lines; null where the server cannot say.
 *
 * @param {number} view @param {AbortSignal} [signal]
 * @returns {Promise<InfluenceJson[] | null>}
 */
export async function getInfluence(view, signal) {
	try {
		return (await request(`/views/${view}/influence`, { signal })).items;
	} catch (error) {
		if (error instanceof ApiError && error.status === 404) return null;
		throw error;
	}
}

/**
 * Let the given calibration count, or the lines.
 *
 * @param {GroupDocument} group @param {ViewJson} view @param {'given' | 'lines'} calibration
 * @returns {Promise<GroupDocument>}
 */
export function chooseCalibration(group, view, calibration) {
	const { station } = view;
	const [path, etag] = station.shared
		? [`/stations/${station.id}?group=${group.id}`, station.etag ?? ''] : [`/views/${view.id}`, group.etag];
	return request(path, { method: 'PATCH', body: { calibration }, etag, key: idempotencyKey() });
}
