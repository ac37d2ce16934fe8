// @ts-check
/** Requests about agreement: annotations of the same frames beside each other. */

import { idempotencyKey, request } from './client.js';

/** @import {GroupDocument} from './types.js' */

/** @typedef {'seen' | 'occluded' | 'out_of_view' | 'none' | 'several'} BallState */
/** @typedef {{marking: string, only: 'a' | 'b' | null, mean_px: number | null, largest_px: number | null}} LineDistanceJson */
/** @typedef {{a: BallState, b: BallState, center_px: number | null, diameter_px: number | null}} BallDistanceJson */
/**
 * @typedef {object} ViewDistanceJson
 * @property {string} view
 * @property {[boolean, boolean]} included
 * @property {LineDistanceJson[]} lines
 * @property {BallDistanceJson} ball
 * @property {[number | null, number | null]} jac of a's camera with b's lines, and of b's with a's
 * @property {number | null} position_m
 */
/**
 * @typedef {object} Ball3DDistanceJson
 * @property {boolean} a
 * @property {boolean} b
 * @property {number | null} distance_m
 * @property {[number | null, number | null]} sigmas_m
 * @property {number | null} p_value
 * @property {boolean | null} explained
 */
/** @typedef {{kind: string, sentence: string, view: string | null, marking: string | null, value: number | null, limit: number | null}} DisagreementJson */
/** @typedef {{line_px: number, markings: number, ball_px: number, diameter_px: number, ball_m: number, jac: number}} LimitsJson */
/** @typedef {{a: number, b: number, distance: {views: ViewDistanceJson[], ball: Ball3DDistanceJson}, disagreements: DisagreementJson[]}} PairJson   a, b: places in `groups` */
/** @typedef {{groups: GroupDocument[], pairs: PairJson[], limits: LimitsJson, worst_views: string[]}} ComparisonJson */

/** @param {number} group @param {number} other @param {AbortSignal} [signal] @returns {Promise<ComparisonJson>} */
export function getComparison(group, other, signal) {
	return request(`/groups/${group}/comparison?with=${other}`, { signal });
}

/** @typedef {{name: string, value: number | null, low: number | null, high: number | null, observed: number | null, items: number}} CoefficientJson */
/** @typedef {{count: number, median: number | null, tail: number | null}} SpreadJson */
/** @typedef {Record<'line_px' | 'ball_px' | 'diameter_px' | 'ball_m' | 'jac' | 'position_m', SpreadJson>} SpreadsJson */
/** @typedef {{people: string[], groups: number, kappa: CoefficientJson | null, spreads: SpreadsJson}} PeopleAgreementJson */
/**
 * @typedef {object} GroupAgreementJson
 * @property {number} group
 * @property {number} number
 * @property {number | null} batch
 * @property {'agreed' | 'open' | 'decided'} state
 * @property {'unreviewed' | 'accepted' | 'rejected' | 'deferred'} status the verdict on the group itself
 * @property {string[]} people
 * @property {(string | null)[]} verdicts
 * @property {number} worst how many times its limit the worst disagreement was
 * @property {number} disagreements
 * @property {SpreadsJson} spreads
 * @property {'take' | 'start' | null} outcome
 * @property {string | null} taken whose annotation was taken over
 * @property {string | null} decided
 * @property {string | null} decided_by
 */
/** @typedef {{agreed: number, open: number, decided: number, limits: LimitsJson, alpha: CoefficientJson, overall: PeopleAgreementJson, pairs: PeopleAgreementJson[], groups: GroupAgreementJson[]}} AgreementJson */
/** @typedef {{group: number, number: number, batch: number | null, people: string[], worst: number, disagreements: number, since: string}} WaitingJson */
/** @typedef {{group: GroupDocument, batch: number | null, annotations: {id: number, person: string, verdict: string | null, submitted: string | null}[], comparison: ComparisonJson, refused: string | null, own: boolean}} CaseJson */

/** @param {number | null} batch null: all */
const ofBatch = (batch) => (batch === null ? '' : `?of_batch=${batch}`);

/** @param {string} dataset @param {AbortSignal} [signal] @param {number | null} [batch] 0: what belongs to none @returns {Promise<AgreementJson>} */
export function getAgreement(dataset, signal, batch = null) {
	return request(`/datasets/${encodeURIComponent(dataset)}/agreement${ofBatch(batch)}`, { signal });
}

/** Where the file of a dataset's agreement is. @param {string} dataset @param {number | null} batch */
export const agreementFile = (dataset, batch) => `/api/v1/datasets/${encodeURIComponent(dataset)}/agreement/groups.csv${ofBatch(batch)}`;

/** @param {string} dataset @param {LimitsJson} limits @returns {Promise<LimitsJson>} */
export function putLimits(dataset, limits) {
	return request(`/datasets/${encodeURIComponent(dataset)}/agreement/limits`, { method: 'PUT', body: limits });
}

/** @param {string} dataset @param {AbortSignal} [signal] @returns {Promise<{items: WaitingJson[]}>} */
export function getWaiting(dataset, signal) {
	return request(`/datasets/${encodeURIComponent(dataset)}/adjudications`, { signal });
}

/** @param {number} group @param {AbortSignal} [signal] @returns {Promise<CaseJson>} */
export function getCase(group, signal) {
	return request(`/groups/${group}/adjudication`, { signal });
}

/** @param {number} group @param {number} annotation @param {boolean} asStart @returns {Promise<GroupDocument>} */
export function postDecision(group, annotation, asStart) {
	return request(`/groups/${group}/adjudication`, { method: 'POST', body: { annotation, as_start: asStart }, key: idempotencyKey() });
}

/** @param {number} group @param {number} annotation @param {string} reason @returns {Promise<void>} */
export function postReturnForCorrection(group, annotation, reason) {
	return request(`/groups/${group}/adjudication/return`, { method: 'POST', body: { annotation, reason } });
}
