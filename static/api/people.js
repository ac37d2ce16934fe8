// @ts-check
/** Who is logged in, their sessions, and everybody who has an account. */

import { request } from './client.js';

/** @typedef {'viewer' | 'annotator' | 'reviewer' | 'lead' | 'admin'} Role */
/** @typedef {'account' | 'read' | 'annotate' | 'review' | 'lead' | 'administer'} Action */
/** @typedef {{team: boolean, name: string | null, role: Role | null, may: Action[]}} SessionJson */
/** @typedef {{id: number, this: boolean, browser: string, address: string, created: string, seen: string, expires: string}} OpenSessionJson */
/** @typedef {{id: number, name: string, role: Role, disabled: boolean, joined: boolean, invited: boolean, created: string, created_by: string, seen: string | null}} UserJson */
/** @typedef {{user: UserJson, link: string, expires: string}} UserWithLink */

/** @returns {Promise<SessionJson>} */
export const getSession = () => request('/session');

/** @param {string} name @param {string} password @returns {Promise<SessionJson>} */
export const postSession = (name, password) => request('/session', { method: 'POST', body: { name, password } });

/** @returns {Promise<SessionJson>} */
export const deleteSession = () => request('/session', { method: 'DELETE' });

/** @param {string} old @param {string} fresh @returns {Promise<SessionJson>} */
export const putPassword = (old, fresh) => request('/session/password', { method: 'PUT', body: { old, new: fresh } });

/** @returns {Promise<{items: OpenSessionJson[]}>} */
export const getSessions = () => request('/sessions');

/** End a session of one's own; null: all but this one. @param {number | null} id */
export const endSession = (id) => request(id === null ? '/sessions' : `/sessions/${id}`, { method: 'DELETE' });

/** @param {string} token @returns {Promise<{name: string | null, joined: boolean}>} */
export const lookAtLink = (token) => request('/links/look', { method: 'POST', body: { token } });

/** @param {{token: string, password: string, name?: string}} body @returns {Promise<SessionJson>} */
export const postLink = (body) => request('/links/use', { method: 'POST', body });

/** @returns {Promise<{items: UserJson[]}>} */
export const getUsers = () => request('/users');

/** @param {string} name @param {Role} role @returns {Promise<UserWithLink>} */
export const postUser = (name, role) => request('/users', { method: 'POST', body: { name, role } });

/** @param {number} id @param {{role?: Role, disabled?: boolean}} body @returns {Promise<UserJson>} */
export const patchUser = (id, body) => request(`/users/${id}`, { method: 'PATCH', body });

/** @param {number} id @returns {Promise<UserWithLink>} */
export const postUserLink = (id) => request(`/users/${id}/link`, { method: 'POST' });
