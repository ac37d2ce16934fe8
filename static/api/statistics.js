// @ts-check
/** Requests about how the numbers of a dataset are spread. */

import { queryText, request } from './client.js';

/**
 * @typedef {object} SpreadJson
 * @property {string} name
 * @property {string} label
 * @property {string} unit
 * @property {string} field of the query
 * @property {number[]} edges
 * @property {boolean} open_low the first bar also holds what lies below
 * @property {boolean} open_high
 * @property {boolean} log bars are powers of ten apart; the first holds 0 and what is smaller
 * @property {string[]} queries for each bar, the words that find its groups
 * @property {{split: string, counts: number[], unknown: number}[]} series
 */

/** @typedef {{match: string, split: string, groups: number, passing: number, accepted: number}} MatchCounts */

/**
 * @typedef {object} StatisticsJson
 * @property {number} groups
 * @property {SpreadJson[]} histograms
 * @property {{x_edges: number[], y_edges: number[], counts: number[][], outside: number}} positions
 * @property {MatchCounts[]} matches
 * @property {{split: string, groups: number, passing: number, accepted: number}[]} splits
 */

/** @param {number} dataset @param {string} q @param {AbortSignal} [signal] @returns {Promise<StatisticsJson>} */
export function getStatistics(dataset, q, signal) {
	return request(`/datasets/${dataset}/statistics${queryText({ q })}`, { signal });
}
