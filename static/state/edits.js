// @ts-check
/** Edits: values that say what a person changed, and how the group looks with it. */

import { leftOutText } from './reasons.js';

/** @import {BallJson, EditJson, GroupDocument, LeftOutJson, PictureJson, PointJson, ViewJson} from '../api/types.js' */

/** @typedef {{kind: 'lines', view: string, lines: Record<string, PointJson[] | null>, proposed?: string[], notVisible?: string[], staged?: boolean}} LinesEdit   proposed: those whose points are as they were proposed; notVisible: those without points that the picture does not show; staged: it was staged in the calibration editor */
/** @typedef {{kind: 'ball', view: string, ball: BallJson | null, prediction?: {id: number, replace: boolean}}} BallEdit   prediction: that this ball is accepted from */
/** @typedef {{kind: 'include', view: string, included: boolean, reason?: string | null, note?: string | null}} IncludeEdit   reason: why it is left out, one of REASONS */
/** @typedef {{kind: 'picture', view: string, picture: PictureJson | null}} PictureEdit   what was done to the picture since it was taken */
/** @typedef {LinesEdit | BallEdit | IncludeEdit | PictureEdit} Edit */

/**
 * The group with the edit applied; its solution stays the old one.
 *
 * @param {GroupDocument} group @param {Edit} edit
 * @returns {GroupDocument}
 */
export function applyEdit(group, edit) {
	return {
		...group,
		views: group.views.map((view) => (view.key === edit.view ? editView(view, edit) : view)),
	};
}

/** @param {ViewJson} view @param {Edit} edit @returns {ViewJson} */
function editView(view, edit) {
	if (edit.kind === 'include') return { ...view, included: edit.included, left_out: leftOutBy(edit) };
	if (edit.kind === 'ball') return { ...view, balls: edit.ball ? [edit.ball] : [] };
	if (edit.kind === 'picture') return { ...view, station: { ...view.station, picture: edit.picture } };
	const lines = { ...view.lines };
	for (const [marking, points] of Object.entries(edit.lines)) {
		if (points) lines[marking] = points;
		else delete lines[marking];
	}
	const proposed = [...(view.proposed ?? []).filter((marking) => !(marking in edit.lines)), ...(edit.proposed ?? [])].sort();
	const unseen = [...(view.not_visible ?? []).filter((marking) => !(marking in edit.lines)), ...(edit.notVisible ?? [])].sort();
	return { ...view, lines, proposed, not_visible: unseen };
}

/**
 * Where and what to send for an edit.
 *
 * @param {GroupDocument} group @param {Edit} edit
 * @returns {{path: string, body: unknown, etag: string, method?: 'POST'}}
 */
export function requestOf(group, edit) {
	const view = viewOf(group, edit.view);
	if (edit.kind === 'include') {
		return { path: `/views/${view.id}`, body: includeBody(edit), etag: group.etag };
	}
	if (edit.kind === 'picture') return { path: `/views/${view.id}`, body: { picture: edit.picture }, etag: group.etag };
	if (edit.kind === 'ball' && edit.prediction) {
		const { id, replace } = edit.prediction;
		const path = `/views/${view.id}/predictions/${id}/accept?replace=${replace}`;
		return { path, body: undefined, etag: group.etag, method: 'POST' };
	}
	if (edit.kind === 'ball') {
		return { path: `/views/${view.id}/ball`, body: edit.ball && ballBody(edit.ball), etag: group.etag };
	}
	const body = {
		lines: edit.lines, ...(edit.proposed?.length ? { proposed: edit.proposed } : {}), ...(edit.notVisible?.length ? { not_visible: edit.notVisible } : {}),
	};
	// The lines of a static camera belong to its station, which has a state of its own.
	if (!view.station.shared) return { path: `/views/${view.id}/lines`, body, etag: group.etag };
	const etag = view.station.etag ?? group.etag;
	return { path: `/stations/${view.station.id}/lines?group=${group.id}`, body, etag };
}

/**
 * The shared station that an edit changes, or null.
 *
 * @param {GroupDocument} group @param {Edit} edit
 * @returns {number | null}
 */
export function stationOf(group, edit) {
	const { station } = viewOf(group, edit.view);
	return edit.kind === 'lines' && station.shared ? station.id : null;
}

/** @param {Edit} edit @returns {unknown} the body that asks what the edit would change */
export function previewBody(edit) {
	if (edit.kind === 'lines') return { views: { [edit.view]: { lines: edit.lines } } };
	if (edit.kind === 'ball') {
		return { views: { [edit.view]: { ball: edit.ball && ballBody(edit.ball) } } };
	}
	if (edit.kind === 'picture') return { views: { [edit.view]: { picture: edit.picture } } };
	return { views: { [edit.view]: { included: edit.included } } };
}

/** What an edit says of why a view is left out. @param {IncludeEdit} edit @returns {LeftOutJson | null} */
export function leftOutBy({ included, reason, note }) {
	return included || !reason ? null : { reason, note: note ?? null };
}

/** @param {IncludeEdit} edit */
function includeBody(edit) {
	return { included: edit.included, ...leftOutBy(edit) };
}

/** Whether a ball was followed there from another group, and not predicted. @param {string | null | undefined} source */
export function isFollowed(source) {
	return Boolean(source?.startsWith('followed from '));
}

/** @param {BallJson} ball */
function ballBody(ball) {
	const { box, point, occluded, out_of_view, inferred } = ball;
	const said = { occluded, out_of_view, ...(inferred ? { inferred } : {}) };
	if (box) return { box, ...said };
	return point ? { point, ...said } : said;
}

/** @param {GroupDocument} group @param {string} key @returns {ViewJson} */
export function viewOf(group, key) {
	const view = group.views.find((candidate) => candidate.key === key);
	if (!view) throw new RangeError(`no view ${key} in group ${group.id}`);
	return view;
}

/** Whether the second edit says all that the first one says. @param {Edit} a @param {Edit} b */
export function sameTarget(a, b) {
	if (a.kind !== b.kind || a.view !== b.view) return false;
	return a.kind !== 'lines' || b.kind !== 'lines'
		|| Object.keys(a.lines).every((marking) => marking in b.lines);
}

/** As many markings are named; more nobody listens to. */
const FEW = 3;

/** What an edit did, in words. @param {GroupDocument} group @param {Edit} edit */
export function describe(group, edit) {
	const { letter } = viewOf(group, edit.view);
	if (edit.kind === 'include') return `View ${letter} ${edit.included ? 'included' : leftOutText(leftOutBy(edit))}`;
	if (edit.kind === 'ball' && edit.prediction) return `Ball of ${letter} accepted from ${edit.ball?.predicted_by}`;
	if (edit.kind === 'ball') return `Ball of ${letter} changed`;
	if (edit.kind === 'picture') return `Picture of ${letter} ${edit.picture ? 'treated as stretched or cropped' : 'treated as unchanged'}`;
	const drawn = Object.keys(edit.lines).filter((marking) => edit.lines[marking]);
	const markings = drawn.length ? drawn : Object.keys(edit.lines);
	if (edit.notVisible?.length && edit.notVisible.length === markings.length) return `${markings.join(', ')} of ${letter} marked as not visible`;
	if (edit.proposed?.length === markings.length) return `Lines of ${letter} accepted as proposed`;
	return `${markings.length > FEW ? `${markings.length} markings` : markings.join(', ')} of ${letter} changed`;
}

/**
 * A line edit that puts one point somewhere else, or takes it away.
 *
 * @param {ViewJson} view @param {string} marking @param {number} index
 * @param {PointJson | null} to null deletes; a marking without points goes
 * @returns {LinesEdit}
 */
export function movePoint(view, marking, index, to) {
	const points = (view.lines[marking] ?? []).slice();
	if (to) points[index] = to;
	else points.splice(index, 1);
	return { kind: 'lines', view: view.key, lines: { [marking]: points.length ? points : null } };
}

const SIDES = /** @type {Record<string, string>} */ ({
	left: 'right', right: 'left', top: 'bottom', bottom: 'top',
});

/** The marking that this one becomes when the pitch turns by 180 degrees. @param {string} marking */
export function twinMarking(marking) {
	const parts = marking.split(' ');
	if (parts[0] === 'Goal' && parts[2] === 'post') {
		// Both goals name their posts as seen from the pitch, so a half turn keeps the post.
		return `Goal ${SIDES[parts[1]]} post ${parts[3]}`;
	}
	return parts.map((word) => SIDES[word] ?? word).join(' ');
}

/** An edit as the server writes it. @param {EditJson} said @returns {Edit} */
export function editOf(said) {
	const { view } = said;
	if (said.edit === 'include_view') return { kind: 'include', view, included: said.included };
	if (said.edit === 'set_picture') return { kind: 'picture', view, picture: said.picture };
	if (said.edit === 'set_balls') return { kind: 'ball', view, ball: said.balls[0] ?? null };
	const lines = Object.entries(said.lines).map(([marking, points]) => [marking, points?.length ? points.map(([x, y]) => ({ x, y })) : null]);
	const source = said.source ?? {};
	const [proposed, notVisible] = ['proposed', 'not_visible'].map((wanted) => Object.keys(source).filter((marking) => source[marking] === wanted));
	return { kind: 'lines', view, lines: Object.fromEntries(lines), ...(proposed.length ? { proposed } : {}), ...(notVisible.length ? { notVisible } : {}) };
}

/** Every marking of a view under its twin's name. @param {ViewJson} view @returns {LinesEdit} */
export function swapSides(view) {
	/** @type {Record<string, PointJson[] | null>} */
	const lines = Object.fromEntries(Object.keys(view.lines).map((marking) => [marking, null]));
	for (const [marking, points] of Object.entries(view.lines)) lines[twinMarking(marking)] = points;
	const proposed = (view.proposed ?? []).map(twinMarking);
	const hidden = view.not_visible ?? [];
	const notVisible = hidden.map(twinMarking);
	for (const marking of [...hidden, ...notVisible]) lines[marking] ??= null;
	return { kind: 'lines', view: view.key, lines, ...(proposed.length ? { proposed } : {}), ...(notVisible.length ? { notVisible } : {}) };
}

/** A marking of a view that the picture does not show, or one that it shows after all. @param {ViewJson} view @param {string} marking @param {boolean} hidden @returns {LinesEdit} */
export function markNotVisible(view, marking, hidden) {
	return { kind: 'lines', view: view.key, lines: { [marking]: null }, ...(hidden ? { notVisible: [marking] } : {}) };
}
