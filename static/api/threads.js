// @ts-check
/** Requests about what people say to each other about a group. */

import { request } from './client.js';

/** @import {PointJson} from './types.js' */

/** @typedef {{id: number, actor: string, at: string, edited: string | null, text: string | null, mentions: string[], mine: boolean}} CommentJson */
/** @typedef {{id: number, view: string | null, at: PointJson | null, created: string, resolved: string | null, resolved_by: string | null, comments: CommentJson[]}} ThreadJson */
/** @typedef {{text: string, view?: string, at?: PointJson}} NewThread */

/** @param {number} group @param {string} [rest] */
const at = (group, rest = '') => `/groups/${group}/threads${rest}`;

/** @param {number} group @param {AbortSignal} [signal] @returns {Promise<{items: ThreadJson[]}>} */
export const getThreads = (group, signal) => request(at(group), { signal });

/** @param {number} group @returns {Promise<{names: string[]}>} who can be mentioned */
export const getPeopleOfGroup = (group) => request(`/groups/${group}/people`);

/** @param {number} group @param {NewThread} body @returns {Promise<ThreadJson>} */
export const postThread = (group, body) => request(at(group), { method: 'POST', body });

/** @param {number} group @param {number} thread @param {boolean} resolved @returns {Promise<ThreadJson>} */
export const patchThread = (group, thread, resolved) => request(at(group, `/${thread}`), { method: 'PATCH', body: { resolved } });

/** @param {number} group @param {number} thread @param {string} text @returns {Promise<ThreadJson>} */
export const postReply = (group, thread, text) => request(at(group, `/${thread}/comments`), { method: 'POST', body: { text } });

/** @param {number} group @param {number} thread @param {number} comment @param {string} text @returns {Promise<ThreadJson>} */
export const patchComment = (group, thread, comment, text) => request(at(group, `/${thread}/comments/${comment}`), { method: 'PATCH', body: { text } });

/** @param {number} group @param {number} thread @param {number} comment */
export const deleteComment = (group, thread, comment) => request(at(group, `/${thread}/comments/${comment}`), { method: 'DELETE' });
