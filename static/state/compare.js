// @ts-check
/** Annotations of the same frames beside each other: which view, what is shown, what is spoken about. */

import { computed, signal } from '@preact/signals';

import { fitPanel, isZoomed, zoomTo } from './viewports.js';

/** @import {ComparisonJson, DisagreementJson, ViewDistanceJson} from '../api/agreement.js' */
/** @import {ViewJson} from '../api/types.js' */

/** What is compared; null while it is read. */
export const comparison = signal(/** @type {ComparisonJson | null} */ (null));
/** Key of the view that is shown. */
export const shownView = signal('');
/** Whether each picture shows what the other one drew, too. */
export const others = signal(true);
/** The difference that is pointed out. */
export const pointed = signal(/** @type {DisagreementJson | null} */ (null));

/** The two that disagree most. @type {import('@preact/signals').ReadonlySignal<import('../api/agreement.js').PairJson | null>} */
export const pair = computed(() => comparison.value?.pairs[0] ?? null);

/** What is different in a view. @param {string} key @returns {DisagreementJson[]} */
export function differencesOf(key) {
	return (pair.value?.disagreements ?? []).filter(({ view }) => view === key);
}

/** The numbers of the shown view. @type {import('@preact/signals').ReadonlySignal<ViewDistanceJson | null>} */
export const numbers = computed(() => pair.value?.distance.views.find(({ view }) => view === shownView.value) ?? null);

/** Views, the worst first. @returns {ViewJson[]} */
export const orderedViews = computed(() => {
	const found = comparison.value;
	if (!found) return [];
	const views = new Map(found.groups[0].views.map((view) => [view.key, view]));
	return found.worst_views.flatMap((key) => views.get(key) ?? []);
});

/** Show what was read, its worst view first. @param {ComparisonJson} found */
export function show(found) {
	comparison.value = found;
	pointed.value = null;
	shownView.value = found.worst_views[0] ?? '';
}

/** @param {string} key */
export function showView(key) {
	if (key === shownView.value) return;
	shownView.value = key;
	if (pointed.value?.view !== key) pointed.value = null;
}

/** The next view, or the one before. @param {number} step */
export function stepView(step) {
	const views = orderedViews.value;
	const at = views.findIndex(({ key }) => key === shownView.value);
	if (views.length > 0) showView(views[(at + step + views.length) % views.length].key);
}

/** The next difference, or the one before. @param {number} step */
export function stepDifference(step) {
	const all = pair.value?.disagreements ?? [];
	if (all.length === 0) return;
	const at = pointed.value === null ? (step > 0 ? -1 : 0) : all.indexOf(pointed.value);
	pointOut(all[(at + step + all.length) % all.length]);
}

/** @param {DisagreementJson} difference */
export function pointOut(difference) {
	pointed.value = difference;
	if (difference.view !== null) shownView.value = difference.view;
}

/** Under which all pictures of a view share zoom and place. @param {ViewJson} view */
export const sharedKey = (view) => `compare ${view.letter}`;

/** Screen pixels per image pixel when zoomed to the ball. */
const CLOSE = 6;

/** Zoom all pictures to the ball; again: whole. @param {{width: number, height: number}} panel */
export function zoomToBall(panel) {
	const found = comparison.value;
	const views = (found?.groups ?? []).flatMap(({ views: all }) => all.filter(({ key }) => key === shownView.value));
	if (views.length === 0) return;
	const key = sharedKey(views[0]);
	const ball = views.flatMap(({ balls }) => balls).find(({ out_of_view: gone }) => !gone);
	if (isZoomed(key) || !ball) { fitPanel(key); return; }
	const [x, y] = ball.box ? [ball.box[0] + ball.box[2] / 2, ball.box[1] + ball.box[3] / 2] : ball.point ?? [0, 0];
	zoomTo(key, panel, { x, y }, CLOSE);
}
