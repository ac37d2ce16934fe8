// @ts-check
/** Requests about what was said of a group, and about what everybody did. */

import { queryText, request } from './client.js';

/** @import {BallJson, LinesJson} from './types.js' */

/** @typedef {{id: number, at: string, actor: string, kind: string, body: any}} LogEntryJson */
/** @typedef {{included: boolean, calibration: string, lines: LinesJson, balls: BallJson[]}} PastView */
/** @typedef {{key: string, letter: string, width: number, height: number, image: string | null, before: PastView | null, after: PastView | null}} ChangedView */
/** @typedef {{length: number, width: number}} PitchSize */
/** @typedef {{entry: LogEntryJson, views: ChangedView[], pitch_before: PitchSize | null, pitch_after: PitchSize}} StepJson */
/** @typedef {'edit' | 'verdict' | 'comment' | 'policy' | 'version' | 'import' | 'people' | 'job' | 'other'} Family */
/** @typedef {{id: number, at: string, actor: string, family: Family, kind: string, sentence: string, dataset: string | null, group_id: number | null, group: string | null, network: string | null, address: string | null, hash: string}} AuditEntryJson */
/** @typedef {{dataset?: string, group?: string, person?: string, family?: string, since?: string, until?: string, q?: string}} AuditFilter */

/** @param {number} group @param {AbortSignal} [signal] @returns {Promise<{items: LogEntryJson[]}>} */
export const getHistory = (group, signal) => request(`/groups/${group}/history`, { signal });

/** @param {number} group @param {number} entry @param {AbortSignal} [signal] @returns {Promise<StepJson>} */
export const getStep = (group, entry, signal) => request(`/groups/${group}/history/${entry}`, { signal });

/** @param {AuditFilter} filter @param {string | null} cursor @param {AbortSignal} [signal] @returns {Promise<{items: AuditEntryJson[], next: string | null}>} */
export const getAudit = (filter, cursor, signal) => request(`/audit${queryText({ ...filter, cursor })}`, { signal });

/** Where the same is as a file. @param {AuditFilter} filter @param {'csv' | 'jsonl'} ending */
export const auditFile = (filter, ending) => `/api/v1/audit/export.${ending}${queryText(filter)}`;
