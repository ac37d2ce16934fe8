// @ts-check
/**
 * The group on screen: what the server last said, the writes on their way, the edit in hand.
 *
 * The document is replaced, never changed. What people see is the document with the edits laid
 * over it, so an answer that arrives in the middle of a drag disturbs nothing.
 */

import { batch, computed, signal } from '@preact/signals';

import * as client from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { previewBall } from '../geometry/preview.js';
import { latest } from '../lib/latest.js';
import { stored } from '../lib/storage.js';
import { known, load, rememberAnswer } from './documents.js';
import { applyEdit, describe, previewBody, requestOf, sameTarget, stationOf, viewOf } from './edits.js';
import { did, forgetUndoneEdit, learnTime } from './last_action.js';
import { announce, complain } from './notice.js';
import { discard, enqueue, outbox, revise, takenBack } from './outbox.js';
import { withDismissals } from './open_findings.js';
import { refuses } from './rights.js';
import { hearFrom, isAway, wake } from './sending.js';
import { resetForGroup } from './workspace.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */
/** @import {Edit} from './edits.js' */
/** @import {Base, Item, Turn, Verdict} from './outbox.js' */

const PREVIEW_INTERVAL = 100;

/** The group as the server last gave it. */
export const groupDocument = signal(/** @type {GroupDocument | null} */ (null));
/** The edit in hand while something is dragged. */
export const draft = signal(/** @type {Edit | null} */ (null));
/** What the server expects of the edits not yet saved. */
const expected = signal(/** @type {SolutionJson | null} */ (null));

/** What the person said about this group and the server has not answered yet. */
const own = computed(() => outbox.value.filter(({ group: id, held }) => id === groupDocument.value?.id && !held));
/** Edits of this group that the server has not answered yet. */
export const pending = computed(() => own.value.flatMap(({ edit }) => (edit ? [edit] : [])));

/** Everything that the server does not have yet. */
export const unsaved = computed(() => outbox.value.length + (draft.value ? 1 : 0));

const edits = computed(() => (draft.value ? [...pending.value, draft.value] : pending.value));

/** The group as people see it, edits and verdict included. */
export const group = computed(() => {
	const base = groupDocument.value;
	if (!base) return null;
	const last = own.value.findLast(({ verdict }) => verdict);
	const said = last?.verdict;
	const edited = edits.value.reduce(applyEdit, base);
	if (!said) return edited;
	// What undo restores is as it was, also where the group was edited after it.
	if (last.turn?.field === 'undo_of') return { ...edited, verdict: { ...base.verdict, ...said } };
	// Whether it was mended is the server's to say; of what was rejected it never is.
	const fixed = base.verdict.fixed && said.state === 'accepted';
	return { ...edited, verdict: { ...base.verdict, ...said, fixed, stale: false } };
});

/** The solution that fits `group`: the server's, with the ball computed here while it moves. */
export const solution = computed(() => {
	const saved = groupDocument.value?.solution;
	const base = withDismissals(expected.value ?? saved ?? null, saved);
	const moved = edits.value.some((edit) => edit.kind !== 'lines');
	return group.value && base && moved ? previewBall(group.value, base) : base;
});

/** Whether what is shown is not yet what the server computed. */
export const isPreview = computed(() => edits.value.length > 0);

const asking = latest(PREVIEW_INTERVAL, async (/** @type {Edit} */ edit, abort) => {
	const id = groupDocument.value?.id;
	if (id === undefined || isAway.value) return;
	try {
		const answer = await client.preview(id, previewBody(edit), abort);
		if (id === groupDocument.value?.id && edits.value.length > 0) expected.value = answer.solution;
	} catch (error) {
		// A preview is a courtesy: the save that follows will say what is wrong.
		if (!(error instanceof ApiError)) throw error;
	}
});

/**
 * Show another group; a group that is known already is shown at once and checked afterwards.
 *
 * @param {number} id
 */
export async function open(id) {
	if (groupDocument.value?.id !== id) turnTo(id);
	wanted = id;
	try {
		const loaded = await load(id);
		if (wanted === id) renew(loaded);
	} catch (error) {
		// What is known can be worked on while the server is away.
		if (!(error instanceof ApiError) || error.status !== 0 || groupDocument.value?.id !== id) throw error;
	}
}

/** The group that the person asked for last; answers about others come too late. */
let wanted = 0;

/** Show what is known of a group, at once; nothing asked or selected stays. @param {number} id */
function turnTo(id) {
	settle();
	wanted = id;
	resetForGroup();
	show(known(id) ?? null);
}

/** @param {GroupDocument | null} next */
function show(next) {
	asking.cancel();
	batch(() => {
		groupDocument.value = next;
		draft.value = null;
		expected.value = null;
	});
}

/** Show a newer state of the group on screen, unless the person is in the middle of something. @param {GroupDocument} newer */
export function renew(newer) {
	const present = groupDocument.value;
	// A late answer about the group before must not stand where another is waited for.
	if (newer.id !== (present?.id ?? wanted)) return;
	const untouched = own.value.length === 0 && draft.value === null && present?.etag !== newer.etag;
	if (present === null || untouched) show(newer);
}

/** Lay an edit over the group without saving it. @param {Edit} edit */
export function propose(edit) {
	if (refuses('annotate', groupDocument.value?.dataset.name)) return;
	if (draft.value && !sameTarget(draft.value, edit)) settle();
	draft.value = edit;
	// Cameras, gates and uncertainty are the server's; a ball moves without waiting for them.
	asking.run(edit);
}

/** Drop the edit in hand. */
export function withdraw() {
	asking.cancel();
	draft.value = null;
	if (pending.value.length === 0) expected.value = null;
}

/** Save the edit in hand, before something else happens to the group. */
export function settle() {
	if (draft.value) submit(draft.value);
}

/** Save an edit. @param {Edit} edit */
export function submit(edit) {
	const at = groupDocument.value;
	if (!at || refuses('annotate', at.dataset.name)) return;
	const shown = pending.value.reduce(applyEdit, at);
	batch(() => {
		draft.value = null;
		did({ kind: 'edit', dataset: at.dataset.name, group: at.id, number: at.number, times: 1 });
		enqueue({
			method: 'PATCH', ...requestOf(at, edit), group: at.id, station: stationOf(at, edit), edit,
			verdict: null, base: baseOf(shown, edit.view),
		});
	});
	wake();
}

/**
 * Save a verdict, or undo or redo one that this window gave.
 *
 * @param {Verdict} verdict what the group has by that
 * @param {Turn & {at?: string}} [turn] `at`: when the verdict was given; it is told later where its own write still waits
 * @returns {string | null} key of the write
 */
export function submitVerdict(verdict, turn) {
	const at = groupDocument.value;
	if (!at || refuses('review', at.dataset.name)) return null;
	const { state, reason, note } = verdict;
	const given = turn?.field === 'undo_of' ? { state: 'unreviewed' } : { state, reason, note };
	const { id } = enqueue({
		path: `/groups/${at.id}/verdict`, body: turn ? { ...given, [turn.field]: turn.at } : given, etag: at.etag, group: at.id, method: 'PUT',
		station: null, edit: null, verdict, base: wholeOf(at), turn: turn && { field: turn.field, key: turn.key },
	});
	wake();
	return id;
}

/**
 * Say that a finding was checked, or that it is to be looked at again.
 *
 * @param {import('./last_action.js').FindingName} finding @param {boolean} dismissed @returns {boolean} whether it is on its way
 */
export function submitDismissal(finding, dismissed) {
	const at = groupDocument.value;
	if (!at || refuses('review', at.dataset.name)) return false;
	enqueue({
		path: `/groups/${at.id}/dismissal`, body: { ...finding, dismissed }, etag: at.etag, group: at.id, method: 'PUT',
		station: null, edit: null, verdict: null, base: null,
	});
	wake();
	return true;
}

/** Take the last edit back, or make it again. @param {'undo' | 'redo'} verb */
export function submitTurn(verb) {
	const at = groupDocument.value;
	if (!at || refuses('annotate', at.dataset.name)) return;
	const last = lastStationOf(at.id);
	const station = at.views.find((view) => view.station.id === last)?.station;
	enqueue({
		path: station ? `/stations/${station.id}/${verb}?group=${at.id}` : `/groups/${at.id}/${verb}`,
		body: undefined, etag: station?.etag ?? at.etag, group: at.id, method: 'POST',
		station: station?.id ?? null, edit: null, verdict: null, base: null,
	});
	wake();
}

/** What an edit found of its view. @param {GroupDocument} at @param {string} key @returns {Base} */
function baseOf(at, key) {
	const { lines, not_visible, balls, included, left_out, station } = viewOf(at, key);
	return { lines, not_visible, balls, included, left_out, picture: station.picture ?? null, verdict: at.verdict };
}

/** What a verdict found: all views. @param {GroupDocument} at @returns {Base} */
function wholeOf(at) {
	return { ...baseOf(at, at.views[0]?.key), views: Object.fromEntries(at.views.map(({ key }) => [key, baseOf(at, key)])) };
}

/**
 * Remember an edit that was not sent from here but is on the server, so that undo finds it.
 *
 * @param {GroupDocument} at what it was made of @param {number | null} station the static camera that it changed
 */
export function rememberEdit(at, station) {
	did({ kind: 'edit', dataset: at.dataset.name, group: at.id, number: at.number, times: 1 });
	keepStation(at.id, station);
}

/** Groups whose last edit of this window changed a static camera, the newest last; it outlives a reload. */
const lastStations = stored('last stations', /** @type {{group: number, station: number}[]} */ ([]), 'sessionStorage');
const MOST_STATIONS = 100;

/**
 * The static camera that the last edit of this window on a group changed, answered or not; null: it
 * changed none. Its edits have a line of their own, and undo has to ask there.
 *
 * @param {number | undefined} group
 */
export function lastStationOf(group) {
	const unanswered = outbox.value.findLast((item) => item.group === group && item.edit && !item.held);
	if (unanswered) return unanswered.station;
	return lastStations.value.find((one) => one.group === group)?.station ?? null;
}

/** @param {number} group @param {number | null} station */
function keepStation(group, station) {
	const others = lastStations.value.filter((one) => one.group !== group);
	const kept = station === null ? others : [...others.slice(1 - MOST_STATIONS), { group, station }];
	if (kept.length || lastStations.value.length) lastStations.value = kept;
}

/** @param {Item} item @param {GroupDocument} answer @param {any} [first] the answer to its first sending */
function delivered(item, answer, first) {
	batch(() => {
		discard(({ id }) => id === item.id);
		if (item.verdict && item.turn?.field !== 'undo_of' && first?.verdict?.at) nameVerdict(item.id, first.verdict.at);
		// What follows builds on what this one has made.
		revise((other) => (other.group === item.group && !other.held
			? { ...other, etag: etagFor(other, answer), base: other.verdict ? wholeOf(answer) : other.base } : other));
		takeOver(answer);
		if (pending.value.length === 0 && !draft.value) expected.value = null;
		if (item.edit) keepStation(item.group, item.station);
	});
	if (item.edit) announce(`${describe(answer, item.edit)}, saved.`);
	else if (item.method === 'POST') announce(item.path.includes('/undo') ? 'Undone.' : 'Redone.');
}

/** When a verdict was given is known: what undoes or redoes it names it by that. @param {string} key @param {string} at */
function nameVerdict(key, at) {
	learnTime(key, at);
	revise((other) => (other.turn?.key === key
		? { ...other, body: { .../** @type {object} */ (other.body), [other.turn.field]: at } } : other));
}

/** @param {Item} item @param {GroupDocument} answer */
function etagFor({ station, etag }, answer) {
	if (station === null) return answer.etag;
	return answer.views.find((view) => view.station.id === station)?.station.etag ?? etag;
}

/** @param {Item} item @param {ApiError} error */
function refused(item, error) {
	// Undo and redo of a verdict are about the group as it was: there is nothing to choose.
	const conflicting = error.isConflict && !item.turn && (item.edit !== null || item.verdict !== null);
	const dropped = conflicting ? [] : outbox.value.filter((other) => other.group === item.group && !other.held);
	batch(() => {
		// What was said on top of it falls with it, or waits with it.
		if (conflicting) holdAll(item.group, error.current);
		else discard((other) => dropped.includes(other));
		expected.value = null;
		if (isGroup(error.current)) takeOver(error.current);
	});
	if ((error.isConflict || item.turn) && !isGroup(error.current)) load(item.group).then(renew, () => {});
	if (!conflicting) complain(refusalText(item, dropped, error));
	listener(item, error);
	for (const other of dropped) if (other.id !== item.id && other.verdict) listener(other, error);
	const back = takenBack(dropped);
	lossListener(dropped.filter((other) => !back.includes(other)));
}

/** Hold what waits of a group until the person has chosen. @param {number} id @param {any} current the group as it is now */
function holdAll(id, current) {
	const writes = outbox.value.filter(({ group: of, held }) => of === id && !held);
	const back = takenBack(writes);
	// Undo and redo are about the group as it was, and what was taken back before it was saved nobody has to choose.
	discard((other) => back.includes(other) || (other.group === id && Boolean(other.turn)));
	for (const other of back) if (other.edit) forgetUndoneEdit(id);
	if (back.some(({ edit }) => edit)) announce('Undone.');
	const rest = outbox.value.filter(({ group: of }) => of === id);
	const isChosen = rest.some(({ edit, verdict }) => edit !== null || verdict !== null);
	if (isChosen) revise((other) => (other.group === id ? { ...other, held: true } : other));
	else if (isGroup(current)) revise((other) => (other.group === id ? { ...other, etag: etagFor(other, current) } : other));
}

/** @param {Item} item @param {Item[]} dropped with it @param {ApiError} error */
function refusalText({ id, group: of }, dropped, { message, hint }) {
	const number = known(of)?.number;
	const where = number === undefined ? '' : ` in group ${number}`;
	const text = `Not saved${where}: ${[message, hint].filter(Boolean).join('. ')}`;
	if (!dropped.some((other) => other.id !== id && other.verdict)) return text;
	return `${text.replace(/[^.?!]$/, '$&.')} Its verdict is not saved either.`;
}

/** @type {(item: Item, error: ApiError) => void} */
let listener = () => {};

/** Hear of refused writes, to bring their group back. @param {typeof listener} one */
export function onRefused(one) {
	listener = one;
}

/** @type {(lost: Item[]) => void} */
let lossListener = () => {};

/** Hear of the writes of a group that are not saved and not kept either, in their order. @param {typeof lossListener} one */
export function onLost(one) {
	lossListener = one;
}

/** @param {any} body @returns {body is GroupDocument} */
function isGroup(body) {
	return Array.isArray(body?.views);
}

/** Go on from a newer state of a group. @param {GroupDocument} newer */
export function takeOver(newer) {
	rememberAnswer(newer);
	if (groupDocument.value?.id === newer.id) groupDocument.value = newer;
}

hearFrom({ delivered, refused });
