// @ts-check
/** Tokens with which scripts ask a team's server. */

import { request } from './client.js';

/** @typedef {'read' | 'annotate' | 'review' | 'export' | 'lead' | 'admin'} Scope */
/** @typedef {{id: number, name: string, start: string, scopes: Scope[], dataset: string | null, created: string, expires: string, used: string | null, expired: boolean}} TokenJson */
/** @typedef {{token: TokenJson, text: string}} MadeToken */

/** One's own tokens, or those of another person. @param {number | null} [user] @returns {Promise<{items: TokenJson[]}>} */
export const getTokens = (user = null) => request(user === null ? '/tokens' : `/users/${user}/tokens`);

/** @param {{name: string, scopes: Scope[], days: number, dataset: string | null}} body @returns {Promise<MadeToken>} */
export const postToken = (body) => request('/tokens', { method: 'POST', body });

/** End a token of one's own, or of another person. @param {number} id @param {number | null} [user] */
export const endToken = (id, user = null) => request(user === null ? `/tokens/${id}` : `/users/${user}/tokens/${id}`, { method: 'DELETE' });
