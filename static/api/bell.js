// @ts-check
/** Requests about what somebody is told. */

import { request } from './client.js';

/** @typedef {{id: number, at: string, kind: 'mention' | 'reply' | 'job' | 'assigned' | 'returned', actor: string, sentence: string, address: string, dataset: string | null, group_id: number | null, read: string | null}} RingJson */
/** @typedef {{items: RingJson[], unread: number}} BellJson */

/** @returns {Promise<BellJson>} */
export const getBell = () => request('/bell?limit=50');

/** @param {number[] | null} ids null: all of it @returns {Promise<BellJson>} */
export const postRead = (ids) => request('/bell/read', { method: 'POST', body: { ids } });
