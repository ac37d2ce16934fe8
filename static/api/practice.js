// @ts-check
/** Requests about the practice groups. */

import { request } from './client.js';

/** @import {JobJson} from './jobs.js' */

/**
 * @typedef {object} LessonJson
 * @property {number} group
 * @property {number} number from 1
 * @property {number} total
 * @property {string} title
 * @property {string} question
 * @property {string} hint
 * @property {string} verdict
 * @property {'open' | 'mended' | 'right' | 'almost' | 'wrong'} state
 * @property {string | null} feedback
 * @property {string | null} best
 */

/** @param {AbortSignal} [signal] @returns {Promise<{dataset: string, lessons: LessonJson[]}>} */
export function getPractice(signal) {
	return request('/practice', { signal });
}

/** @param {boolean} again forget what was answered @returns {Promise<JobJson>} */
export function postPractice(again) {
	return request('/practice', { method: 'POST', body: { again } });
}

/**
 * @typedef {object} RecordingLessonJson
 * @property {'shots' | 'cameras' | 'side' | 'link'} name
 * @property {string} question
 * @property {string} hint
 * @property {'open' | 'almost' | 'right'} state
 * @property {string} feedback
 * @property {number} frame where to look
 * @property {number} right
 * @property {number} total
 * @property {number | null} off
 */

/** @param {AbortSignal} [signal] @returns {Promise<{dataset: string, recording: number | null, lessons: RecordingLessonJson[]}>} */
export function getRecordingPractice(signal) {
	return request('/practice/recording', { signal });
}

/** @param {boolean} again begin afresh @returns {Promise<JobJson>} */
export function postRecordingPractice(again) {
	return request('/practice/recording', { method: 'POST', body: { again } });
}
