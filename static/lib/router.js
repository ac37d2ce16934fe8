// @ts-check
/** The address bar: which page is shown, and with which query. */

import { computed, signal } from '@preact/signals';

/** @typedef {{path: string, search: URLSearchParams}} Place */

/** @returns {Place} */
function here() {
	return { path: location.pathname, search: new URLSearchParams(location.search) };
}

/** Where the person is. */
export const place = signal(here());

/** @typedef {'yield' | 'policy' | 'statistics' | 'versions' | 'evaluation' | 'agreement' | 'tracks'} DatasetPage */
/** @typedef {'queue' | 'datasets' | 'import' | 'jobs' | 'work' | 'exports' | 'recordings' | 'account' | 'people' | 'audit' | 'join' | 'login' | 'unknown'} PlainPage */
/** @typedef {{page: PlainPage} | {page: 'help', tab: string} | {page: 'review', group: number | null} | {page: 'calibration' | 'history', group: number} | {page: 'compare', group: number, other: number} | {page: 'adjudicate', group: number} | {page: 'recording', recording: number} | {page: 'link', recording: number, link: number} | {page: 'track', track: number} | {page: DatasetPage, dataset: string}} Page */

const PLAIN = /** @type {{[path: string]: PlainPage}} */ ({
	'/': 'queue', '/groups': 'queue', '/datasets': 'datasets', '/import': 'import', '/jobs': 'jobs', '/work': 'work', '/exports': 'exports', '/recordings': 'recordings',
	'/account': 'account', '/people': 'people', '/audit': 'audit', '/join': 'join', '/login': 'login',
});
/** A dataset without a page is its yield, which says most about it. */
const OF_DATASET = /^\/datasets\/([^/]+)(?:\/(yield|policy|statistics|versions|evaluation|agreement|tracks))?\/?$/;

/** Which page that is. */
export const page = computed(/** @returns {Page} */ () => {
	const { path } = place.value;
	if (Object.hasOwn(PLAIN, path)) return { page: PLAIN[path] };
	const review = /^\/review(?:\/(\d+))?\/?$/.exec(path);
	if (review) return { page: 'review', group: review[1] ? Number(review[1]) : null };
	const editor = /^\/review\/(\d+)\/calibration\/?$/.exec(path);
	if (editor) return { page: 'calibration', group: Number(editor[1]) };
	const compared = /^\/compare\/(\d+)\/(\d+)\/?$/.exec(path);
	if (compared) return { page: 'compare', group: Number(compared[1]), other: Number(compared[2]) };
	const disputed = /^\/adjudicate\/(\d+)\/?$/.exec(path);
	if (disputed) return { page: 'adjudicate', group: Number(disputed[1]) };
	const film = /^\/recordings\/(\d+)\/?$/.exec(path);
	if (film) return { page: 'recording', recording: Number(film[1]) };
	const linked = /^\/recordings\/(\d+)\/links\/(\d+)\/?$/.exec(path);
	if (linked) return { page: 'link', recording: Number(linked[1]), link: Number(linked[2]) };
	const tracked = /^\/tracks\/(\d+)\/?$/.exec(path);
	if (tracked) return { page: 'track', track: Number(tracked[1]) };
	const past = /^\/review\/(\d+)\/history\/?$/.exec(path);
	if (past) return { page: 'history', group: Number(past[1]) };
	const help = /^\/help(?:\/(keys|legend|words|guide|practice))?\/?$/.exec(path);
	if (help) return { page: 'help', tab: help[1] ?? 'keys' };
	const found = OF_DATASET.exec(path);
	if (found) return { page: /** @type {DatasetPage} */ (found[2] ?? 'yield'), dataset: textOf(found[1]) };
	return { page: 'unknown' };
});

/** The name of the dataset that the path speaks of, or "". */
export const pageDataset = computed(() => ('dataset' in page.value ? page.value.dataset : ''));

/** @param {string} part of a path @returns {string} */
function textOf(part) {
	try {
		return decodeURIComponent(part);
	} catch {
		return part;
	}
}

/** @param {string} name @returns {string} */
export function param(name) {
	return place.value.search.get(name) ?? '';
}

/**
 * An address with the given parameters; empty ones are left out.
 *
 * @param {string} path
 * @param {Record<string, string>} values
 */
export function address(path, values) {
	const search = new URLSearchParams();
	for (const [name, value] of Object.entries(values)) if (value) search.set(name, value);
	const text = search.toString();
	return text ? `${path}?${text}` : path;
}

/** @param {string} url @param {{replace?: boolean}} [options] */
export function navigate(url, { replace = false } = {}) {
	if (replace) history.replaceState(null, '', url);
	else history.pushState(null, '', url);
	place.value = here();
}

/** Follow the back button, and links without loading the page again. */
export function startRouter() {
	addEventListener('popstate', () => { place.value = here(); });
	// On the window: what a row or button does with the click comes first.
	addEventListener('click', (event) => {
		if (event.defaultPrevented || event.button !== 0) return;
		if (event.metaKey || event.ctrlKey || event.shiftKey || event.altKey) return;
		const link = event.target instanceof Element ? event.target.closest('a') : null;
		if (!link || link.target || link.hasAttribute('download')) return;
		if (link.origin !== location.origin || link.pathname.startsWith('/api/')) return;
		event.preventDefault();
		navigate(link.pathname + link.search);
	});
}
