// @ts-check
/** Requests about own annotations, gold groups and guidelines. */

import { request } from './client.js';

/** @import {GroupDocument} from './types.js' */

/** @typedef {{id: number, batch: number | null, group: number, dataset: number, of: number | null, number: number | null, title: string, person: string, place: number, begun: string, submitted: string | null, verdict: string | null, settled: string | null, returned: ReturnedJson | null}} IndependentAnnotationJson */
/** @typedef {{group: number, title: string, by: string, at: string, reason: string}} ReturnedJson */
/** @typedef {{count: number, median: number | null, low: number | null, high: number | null}} MedianIntervalJson */
/** @typedef {{line_px: number | null, lines_missing: number, ball_px: number | null, balls_missing: number, ball_m: number | null}} ErrorJson */
/** @typedef {{group: number, label: string, submitted: string, verdict: string | null, true_verdict: string, right: boolean | null, error: ErrorJson, submissions: number}} GoldResultJson */
/** @typedef {{person: string, results: GoldResultJson[], line_px: MedianIntervalJson, ball_px: MedianIntervalJson, ball_m: MedianIntervalJson, judged: number, right: number, right_low: number | null, right_high: number | null}} PersonResultsJson */
/** @typedef {{group: number, label: string, start: string, marked: string, marked_by: string, source: 'verdict' | 'sample' | 'version'}} GoldGroupJson */
/** @typedef {{groups: GoldGroupJson[], people: PersonResultsJson[]}} GoldReportJson */
/** @typedef {{dataset: number, number: number, text: string, versions: {number: number, written: string, written_by: string}[]}} GuidelinesJson */

/** @param {number} group @returns {Promise<IndependentAnnotationJson>} */
export const postIndependentAnnotation = (group) => request(`/groups/${group}/independent-annotations`, { method: 'POST' });

/** @param {number} group a copy @param {AbortSignal} [signal] @returns {Promise<IndependentAnnotationJson>} */
export const getIndependentAnnotation = (group, signal) => request(`/groups/${group}/independent-annotation`, { signal });

/** @param {number} group a copy @returns {Promise<IndependentAnnotationJson>} */
export const postSubmission = (group) => request(`/groups/${group}/submission`, { method: 'POST' });

/** @param {number} group a copy @param {string} reason @returns {Promise<IndependentAnnotationJson>} */
export const postAnnotationReturn = (group, reason) => request(`/groups/${group}/return`, { method: 'POST', body: { reason } });

/** @param {number} group a copy @returns {Promise<GroupDocument>} the group that it is of */
export const postAdoption = (group) => request(`/groups/${group}/adoption`, { method: 'POST' });

/** @param {string} dataset @param {AbortSignal} [signal] @returns {Promise<{items: IndependentAnnotationJson[]}>} */
export const getIndependentAnnotations = (dataset, signal) => request(`/datasets/${encodeURIComponent(dataset)}/independent-annotations`, { signal });

/** @param {number} group @param {string} start @returns {Promise<GoldGroupJson>} */
export const putGold = (group, start) => request(`/groups/${group}/gold`, { method: 'PUT', body: { start } });

/** @param {number} group @param {string} start @returns {Promise<GoldGroupJson>} */
export const patchGold = (group, start) => request(`/groups/${group}/gold`, { method: 'PATCH', body: { start } });

/** @param {number} group @returns {Promise<GoldGroupJson>} */
export const deleteGold = (group) => request(`/groups/${group}/gold`, { method: 'DELETE' });

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<GoldReportJson>} */
export const getGold = (dataset, signal) => request(`/datasets/${dataset}/gold`, { signal });

/** @param {number} dataset @param {AbortSignal} [signal] @param {number} [number] of a version; else the newest @returns {Promise<GuidelinesJson>} */
export const getGuidelines = (dataset, signal, number) => request(`/datasets/${dataset}/guidelines${number ? `?number=${number}` : ''}`, { signal });

/** @param {number} dataset @param {string} text @param {number} based_on @returns {Promise<GuidelinesJson>} */
export const putGuidelines = (dataset, text, based_on) => request(`/datasets/${dataset}/guidelines`, { method: 'PUT', body: { text, based_on } });

/** @param {number} dataset @param {string} upload @returns {Promise<{digest: string, type: string}>} */
export const postGuidelinePicture = (dataset, upload) => request(`/datasets/${dataset}/guidelines/pictures`, { method: 'POST', body: { upload } });

/** @param {number} dataset @param {string} digest */
export const pictureAddress = (dataset, digest) => `/api/v1/datasets/${dataset}/guidelines/pictures/${digest}`;

/** Make gold groups of those whose truth is known. @param {number} dataset @param {{source: 'sample' | 'version', version?: string, start: string}} body @returns {Promise<{groups: number[], left_out: number}>} */
export const postGold = (dataset, body) => request(`/datasets/${dataset}/gold`, { method: 'POST', body });
