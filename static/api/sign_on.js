// @ts-check
/** Single sign-on: where to go, what the provider brought back, and the account that is linked. */

import { request } from './client.js';

/** @import {SessionJson} from './people.js' */

/** @typedef {{issuer: string, shown: string, created: string, used: string | null}} IdentityJson */
/** @typedef {{password: boolean, provider: string | null, only: boolean, identity: IdentityJson | null}} OwnWaysJson */
/** @typedef {{state: string, code: string, iss?: string, factor?: string}} SignOnAnswer */

/** Where to go to log in. @param {{to?: string, link?: string, name?: string}} said @returns {Promise<{address: string}>} */
export const beginSignOn = (said) => request('/session/sign-on/begin', { method: 'POST', body: said });

/** @param {SignOnAnswer} told @returns {Promise<{session: SessionJson, to: string}>} */
export const finishSignOn = (told) => request('/session/sign-on', { method: 'POST', body: told });

/** @returns {Promise<OwnWaysJson>} */
export const getOwnWays = () => request('/session/identity');

/** Where to go to link an account. @param {string | null} password @returns {Promise<{address: string}>} */
export const beginLink = (password) => request('/session/identity/begin', { method: 'POST', body: { password } });

/** @param {string | null} password */
export const deleteIdentity = (password) => request('/session/identity', { method: 'DELETE', body: { password } });

/** Unlink another person's account. @param {number} user */
export const deleteIdentityOf = (user) => request(`/users/${user}/identity`, { method: 'DELETE' });
