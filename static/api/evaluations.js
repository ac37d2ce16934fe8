// @ts-check
/** Requests about predictions and what they are worth. */

import { idempotencyKey, queryText, request } from './client.js';

/** @import {JobJson} from './jobs.js' */

/** @typedef {{value: number | null, low: number | null, high: number | null, count: number, of: number}} CellJson */
/** @typedef {{field: string, low: number | null, high: number | null}} FramesLink */
/** @typedef {{name: string, label: string, unit: string, better: string}} ColumnJson */
/** @typedef {{name: string, label: string, cells: CellJson[], frames: FramesLink | null}} TableRowJson */
/** @typedef {{name: string, title: string, note: string, columns: ColumnJson[], rows: TableRowJson[]}} TableJson */

/**
 * @typedef {object} PredictionSet
 * @property {number} id
 * @property {string} name
 * @property {string} format
 * @property {string} source
 * @property {string} created
 * @property {number} frames
 * @property {number} boxes
 * @property {number} cameras
 * @property {number} tracks
 * @property {number} unknown
 * @property {{[name: string]: any}} report
 */

/**
 * @typedef {object} EvaluationRow
 * @property {number} id
 * @property {string} name
 * @property {string} created
 * @property {string} actor
 * @property {number | null} predictions
 * @property {number | null} careful
 * @property {number | null} version
 * @property {{[name: string]: number}} counts
 * @property {{[name: string]: CellJson}} headline
 */

/** @typedef {EvaluationRow & {pins: {[name: string]: any}, tables: TableJson[], figures: string[]}} EvaluationJson */
/** @typedef {{label: string, unit: string, low: number | null, high: number | null}} AxisJson */

/**
 * @typedef {object} SeriesJson
 * @property {string} name
 * @property {string} label
 * @property {'line' | 'dashed' | 'points'} kind
 * @property {number[]} x
 * @property {number[]} y
 * @property {number[]} low
 * @property {number[]} high
 * @property {number[]} count
 * @property {number | null} color
 * @property {number | null} group_id
 * @property {FramesLink[]} [frames] behind each place, where they are kept
 */

/** @typedef {{title: string, x: AxisJson, y: AxisJson, series: SeriesJson[], marks: {axis: 'x' | 'y', at: number, label: string}[], color: AxisJson | null}} PanelJson */
/** @typedef {{name: string, title: string, note: string, panels: PanelJson[]}} FigureJson */
/** @typedef {{[field: string]: any, frame_id: number, group_id: number, group: string, view: string, match: string}} FrameJson */

/**
 * @typedef {object} ComparisonJson
 * @property {EvaluationRow} first
 * @property {EvaluationRow} second
 * @property {boolean} same_truth
 * @property {string[]} differs what was pinned differently, by name
 * @property {{table: string, row: string, column: string, label: string, unit: string, better: string, first: CellJson | null, second: CellJson | null, change: number | null}[]} numbers
 * @property {string} field
 * @property {number} shared
 * @property {number} better
 * @property {number} worse
 * @property {number} gained
 * @property {number} lost
 * @property {number | null} mean_change
 * @property {{first: FrameJson, second: FrameJson, change: number | null}[]} frames
 * @property {number} total
 */

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{items: PredictionSet[]}>} */
export function getPredictions(dataset, signal) {
	return request(`/datasets/${dataset}/predictions`, { signal });
}

/** @param {number} dataset @param {{name: string, format: string, upload: string | null, cameras_upload: string | null, images_upload: string | null, category: number | null, size: [number, number] | null, cameras_size: [number, number] | null}} body @returns {Promise<PredictionSet>} */
export function postPredictions(dataset, body) {
	return request(`/datasets/${dataset}/predictions`, { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} id */
export function deletePredictions(id) {
	return request(`/predictions/${id}`, { method: 'DELETE' });
}

/** @typedef {{id: number, predictions: number, name: string, box: [number, number, number, number], score: number, scored: boolean, view: number}} PredictionJson */
/** @typedef {{view: number, name: string, score: number | null, by: string | null, at: string | null}} AcceptedJson */
/** @typedef {{sets: number, items: PredictionJson[], accepted: AcceptedJson[]}} GroupPredictionsJson */

/** What was predicted in the views of a group. @param {number} group @param {AbortSignal} [signal] @returns {Promise<GroupPredictionsJson>} */
export function getGroupPredictions(group, signal) {
	return request(`/groups/${group}/predictions`, { signal });
}

/** @param {any} body @param {AbortSignal} [signal] @returns {Promise<any>} the outcome of a dry run, or a job */
export function acceptPredictions(body, signal) {
	return request('/predictions/accept', { method: 'POST', body, signal });
}

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<{items: EvaluationRow[]}>} */
export function getEvaluations(dataset, signal) {
	return request(`/datasets/${dataset}/evaluations`, { signal });
}

/** @param {number} dataset @param {{[name: string]: any}} body @returns {Promise<JobJson>} */
export function postEvaluation(dataset, body) {
	return request(`/datasets/${dataset}/evaluations`, { method: 'POST', body, key: idempotencyKey() });
}

/** @param {number} id @param {AbortSignal} [signal] @returns {Promise<EvaluationJson>} */
export function getEvaluation(id, signal) {
	return request(`/evaluations/${id}`, { signal });
}

/** @param {number} id */
export function deleteEvaluation(id) {
	return request(`/evaluations/${id}`, { method: 'DELETE' });
}

/** @param {number} id @param {string} name @param {AbortSignal} [signal] @returns {Promise<FigureJson>} */
export function getFigure(id, name, signal) {
	return request(`/evaluations/${id}/figures/${name}.json`, { signal });
}

/** The address of a figure as a file. @param {number} id @param {string} name @param {'csv' | 'json' | 'png'} ending */
export function figureAddress(id, name, ending) {
	return `/api/v1/evaluations/${id}/figures/${name}.${ending}`;
}

/** The address of a table as a file. @param {number} id @param {string} name @param {'csv' | 'json'} ending */
export function tableAddress(id, name, ending) {
	return `/api/v1/evaluations/${id}/tables/${name}.${ending}`;
}

/** @typedef {{field?: string, low?: number | null, high?: number | null, missing?: string, sort?: string}} FrameQuery */

/** @param {number} id @param {FrameQuery & {cursor?: string | null}} query @param {AbortSignal} [signal] @returns {Promise<{items: FrameJson[], next: string | null, total: number}>} */
export function getFrames(id, query, signal) {
	return request(`/evaluations/${id}/frames${queryText(query)}`, { signal });
}

/** This run against an older one. @param {number} id @param {number} other @param {string} field @param {AbortSignal} [signal] @returns {Promise<ComparisonJson>} */
export function getComparison(id, other, field, signal) {
	return request(`/evaluations/${id}/compare${queryText({ with: other, field })}`, { signal });
}
