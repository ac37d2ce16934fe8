// @ts-check
/** Who is logged in, their sessions, and everybody who has an account. */

import { queryText, request } from './client.js';

/** @typedef {'none' | 'viewer' | 'annotator' | 'reviewer' | 'lead' | 'admin'} Role */
/** @typedef {{id: number, dataset: string, role: Role}} SingleRole   what somebody is in one dataset */
/** @typedef {{id: number, name: string, role: Role, everywhere: Role, single: Role | null}} MemberJson */
/** @typedef {'account' | 'read' | 'describe' | 'annotate' | 'review' | 'export' | 'lead' | 'administer'} Action */
/** @typedef {{password: boolean, sign_on: string | null}} WaysIn   how people log in */
/** @typedef {{team: boolean, name: string | null, role: Role | null, enrol: boolean, way?: 'password' | 'passkey' | 'sign_on' | null, ways?: WaysIn | null, moment: string | null, maintenance?: import('./maintenance.js').BannerJson | null, may: Action[], datasets: SingleRole[], allows: Record<Role, Action[]>}} SessionJson */
/** @typedef {{id: number, this: boolean, browser: string, address: string, created: string, seen: string, expires: string}} OpenSessionJson */
/** @typedef {{id: number, name: string, role: Role, disabled: boolean, joined: boolean, invited: boolean, created: string, created_by: string, seen: string | null, second_factor: boolean, tokens: number, sign_on: string | null, datasets: SingleRole[]}} UserJson */
/** @typedef {{user: UserJson, link: string | null, expires: string, mailed: boolean, problem: string | null}} UserWithLink   link: null where it went by mail */
/** @typedef {{name: string, role: string, email: string | null}} InvitedPerson */
/** @typedef {{row: number, name: string, role: string, state: 'invited' | 'possible' | 'refused', link: string | null, expires: string | null, mailed: boolean, problem: string | null}} InvitationRow */
/** @typedef {{items: InvitationRow[], dry_run: boolean, invited: number, refused: number, mailed: number}} InvitationReport */

/** @returns {Promise<SessionJson>} */
export const getSession = () => request('/session');

/** @param {string} name @param {string} password @param {string | null} [code] @returns {Promise<SessionJson>} */
export const postSession = (name, password, code = null) => request('/session', { method: 'POST', body: code === null ? { name, password } : { name, password, code } });

/** @returns {Promise<SessionJson>} */
export const deleteSession = () => request('/session', { method: 'DELETE' });

/** @param {string} old @param {string} fresh @returns {Promise<SessionJson>} */
export const putPassword = (old, fresh) => request('/session/password', { method: 'PUT', body: { old, new: fresh } });

/** @typedef {{on: boolean, required: boolean, codes_left: number, authenticator: boolean}} SecondFactorJson */
/** @typedef {{secret: string, uri: string, picture: string}} EnrolmentJson */

/** @returns {Promise<SecondFactorJson>} */
export const getSecondFactor = () => request('/session/second-factor');

/** @param {string | null} password @returns {Promise<EnrolmentJson>} */
export const beginSecondFactor = (password) => request('/session/second-factor', { method: 'POST', body: { password } });

/** @param {string} code @returns {Promise<{codes: string[]}>} */
export const confirmSecondFactor = (code) => request('/session/second-factor/confirm', { method: 'POST', body: { code } });

/** @param {string | null} password */
export const deleteSecondFactor = (password) => request('/session/second-factor', { method: 'DELETE', body: { password } });

/** Take away the second factor of another person. @param {number} user */
export const deleteSecondFactorOf = (user) => request(`/users/${user}/second-factor`, { method: 'DELETE' });

/** @returns {Promise<{require_second_factor: boolean}>} */
export const getTeam = () => request('/team');

/** @param {boolean} on @returns {Promise<{require_second_factor: boolean}>} */
export const putTeam = (on) => request('/team', { method: 'PUT', body: { require_second_factor: on } });

/** @returns {Promise<{items: OpenSessionJson[]}>} */
export const getSessions = () => request('/sessions');

/** End a session of one's own; null: all but this one. @param {number | null} id */
export const endSession = (id) => request(id === null ? '/sessions' : `/sessions/${id}`, { method: 'DELETE' });

/** @param {string} token @returns {Promise<{name: string | null, joined: boolean}>} */
export const lookAtLink = (token) => request('/links/look', { method: 'POST', body: { token } });

/** @param {{token: string, password: string, name?: string}} body @returns {Promise<SessionJson>} */
export const postLink = (body) => request('/links/use', { method: 'POST', body });

/** @returns {Promise<{items: UserJson[], adopted_by: string | null, mail: boolean}>} */
export const getUsers = () => request('/users');

/** @param {string} name @param {Role} role @param {string} [email] where the link goes by mail @returns {Promise<UserWithLink>} */
export const postUser = (name, role, email = '') => request('/users', { method: 'POST', body: { name, role, ...(email ? { email } : {}) } });

/** @param {InvitedPerson[]} people @param {boolean} dryRun @returns {Promise<InvitationReport>} */
export const postInvitations = (people, dryRun) => request(`/users/invitations${queryText({ dry_run: dryRun ? 'true' : '' })}`, { method: 'POST', body: { people } });

/** @param {number} id @param {{role?: Role, disabled?: boolean}} body @returns {Promise<UserJson>} */
export const patchUser = (id, body) => request(`/users/${id}`, { method: 'PATCH', body });

/** @param {number} id @param {string} [email] where the link goes by mail @returns {Promise<UserWithLink>} */
export const postUserLink = (id, email = '') => request(`/users/${id}/link`, { method: 'POST', ...(email ? { body: { email } } : {}) });

/** Show what was done before there were accounts as somebody's; once. @param {number} id @returns {Promise<unknown>} */
export const postAdoption = (id) => request(`/users/${id}/adoption`, { method: 'POST' });

/** @param {string} dataset name or id @returns {Promise<{items: MemberJson[]}>} */
export const getMembers = (dataset) => request(`/datasets/${encodeURIComponent(dataset)}/members`);

/** @param {string} dataset name or id @param {number} id @param {Role | null} role null: as everywhere @returns {Promise<MemberJson>} */
export const putMember = (dataset, id, role) => request(`/datasets/${encodeURIComponent(dataset)}/members/${id}`, { method: 'PUT', body: { role } });
