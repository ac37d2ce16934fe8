// @ts-check
/** Rows of a long list in pages, of which only those that were looked at are there. */

/** @import {GroupRow} from '../api/types.js' */

/** @typedef {ReadonlyMap<number, readonly GroupRow[]>} Pages   by place: page 2 begins with row 2 * PAGE */

export const PAGE = 100;
/** More pages than these are not kept; the farthest from sight go first. */
const KEPT = 40;

/** @param {Pages} pages @param {number} index @returns {GroupRow | null} null while it is not there */
export function rowAt(pages, index) {
	return pages.get(Math.floor(index / PAGE))?.[index % PAGE] ?? null;
}

/** @param {Pages} pages @param {number} id @returns {number} index, or -1 when it is not among them */
export function indexOf(pages, id) {
	for (const [page, rows] of pages) {
		const place = rows.findIndex((row) => row.id === id);
		if (place >= 0) return page * PAGE + place;
	}
	return -1;
}

/**
 * The pages that hold the rows from `first` to `last`.
 *
 * @param {number} first @param {number} last @param {number} [total] rows that there are
 * @returns {number[]}
 */
export function pagesOf(first, last, total = Infinity) {
	const from = Math.floor(Math.max(first, 0) / PAGE);
	const to = Math.floor(Math.min(last, total - 1) / PAGE);
	return Array.from({ length: Math.max(to - from + 1, 0) }, (_, place) => from + place);
}

/** The pages with one more. @param {Pages} pages @param {number} page @param {readonly GroupRow[]} rows @returns {Pages} */
export function withPage(pages, page, rows) {
	const all = [...pages].filter(([other]) => other !== page);
	all.sort(([a], [b]) => Math.abs(a - page) - Math.abs(b - page));
	return new Map([[page, rows], ...all.slice(0, KEPT - 1)]);
}

/**
 * Ids of the rows from `first` to `last`.
 *
 * @param {Pages} pages @param {number} first @param {number} last
 * @returns {number[] | null} null when some are not there
 */
export function idsBetween(pages, first, last) {
	const ids = [];
	for (let index = first; index <= last; index++) {
		const row = rowAt(pages, index);
		if (!row) return null;
		ids.push(row.id);
	}
	return ids;
}
