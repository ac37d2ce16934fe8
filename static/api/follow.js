// @ts-check
/** Requests about a ball that is followed from the view of one group into the groups before and after. */

import { idempotencyKey, request } from './client.js';

/** @typedef {'lost' | 'left' | 'known' | 'end' | 'limit'} FollowEnd */
/**
 * @typedef {object} FollowedItem a view without a ball
 * @property {number} group
 * @property {string} key of its group
 * @property {number} number
 * @property {number} view
 * @property {number} frame
 * @property {string} etag of its group
 * @property {[number, number, number, number]} box
 * @property {number} sigma_px
 * @property {number} confidence
 * @property {'followed' | 'uncertain'} state
 */
/**
 * @typedef {object} FollowedBall
 * @property {number} view
 * @property {string} group key of the group in which it was
 * @property {string} camera
 * @property {number} frame
 * @property {number} first
 * @property {number} last
 * @property {FollowEnd} before why it begins there
 * @property {FollowEnd} after why it ends there
 * @property {boolean} sized whether a camera says how large it is
 * @property {number[]} unreadable numbers of frames that are there and cannot be read
 * @property {FollowedItem[]} items
 */
/** @typedef {{view: number, etag: string, ball: {box: number[], followed_from: string} | null}} BallItem */
/** @typedef {{changed: number, unchanged: number, refused: number, items: {view: number | null, outcome: 'changed' | 'unchanged' | 'refused', etag: string | null}[]}} EditedViews */

/** @param {number} view @param {[number, number]} at pixels of the annotated size @param {AbortSignal} signal @returns {Promise<FollowedBall>} */
export function followBall(view, at, signal) {
	return request(`/views/${view}/ball/follow`, { method: 'POST', body: { at }, signal });
}

/** Set the balls of many views. @param {string} dataset @param {BallItem[]} items @returns {Promise<EditedViews>} */
export function editBalls(dataset, items) {
	return request(`/datasets/${encodeURIComponent(dataset)}/edits`, { method: 'POST', body: { items }, key: idempotencyKey() });
}
