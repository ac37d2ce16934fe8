// @ts-check
/**
 * The group on screen: what the server last said, the edits on their way, the edit in hand.
 *
 * The document is replaced, never changed. What people see is the document with the edits laid
 * over it, so an answer that arrives in the middle of a drag disturbs nothing.
 */

import { computed, signal } from '@preact/signals';

import * as client from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { previewBall } from '../geometry/preview.js';
import { latest } from '../lib/latest.js';
import { known, load, remember } from './documents.js';
import { applyEdit, describe, previewBody, requestOf, sameTarget, stationOf } from './edits.js';
import { announce, complain } from './notice.js';
import { resetForGroup } from './workspace.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */
/** @import {Edit} from './edits.js' */

/** @typedef {{state: 'saved' | 'saving' | 'failed', at: number | null}} Save */
/** @typedef {{edit: Edit, theirs: GroupDocument, sentence: string}} Conflict */

const PREVIEW_INTERVAL = 100;

/** The group as the server last gave it. */
export const document = signal(/** @type {GroupDocument | null} */ (null));
/** Edits that were sent and not answered yet. */
export const pending = signal(/** @type {Edit[]} */ ([]));
/** The edit in hand while something is dragged. */
export const draft = signal(/** @type {Edit | null} */ (null));
/** What the server expects of the edits not yet saved. */
const expected = signal(/** @type {SolutionJson | null} */ (null));
export const save = signal(/** @type {Save} */ ({ state: 'saved', at: null }));
export const conflict = signal(/** @type {Conflict | null} */ (null));

/** Writes on their way, those of groups left behind included. */
const writes = signal(0);
/** What would be lost if the page were closed now. */
export const unsaved = computed(() => writes.value + (draft.value ? 1 : 0));

const edits = computed(() => (draft.value ? [...pending.value, draft.value] : pending.value));

/** The group as people see it, edits included. */
export const group = computed(() => (
	document.value && edits.value.reduce(applyEdit, document.value)
));

/** The solution that fits `group`: the server's, with the ball computed here while it moves. */
export const solution = computed(() => {
	const base = expected.value ?? document.value?.solution ?? null;
	const moved = edits.value.some((edit) => edit.kind !== 'lines');
	return group.value && base && moved ? previewBall(group.value, base) : base;
});

/** Whether what is shown is not yet what the server computed. */
export const isPreview = computed(() => edits.value.length > 0);

const asking = latest(PREVIEW_INTERVAL, async (/** @type {Edit} */ edit, abort) => {
	const id = document.value?.id;
	if (id === undefined) return;
	try {
		const answer = await client.preview(id, previewBody(edit), abort);
		if (id === document.value?.id && edits.value.length > 0) expected.value = answer.solution;
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
	if (document.value?.id !== id) turnTo(id);
	wanted = id;
	const loaded = await load(id);
	if (wanted !== id) return;
	const untouched = edits.value.length === 0 && document.value?.etag !== loaded.etag;
	if (document.value === null || untouched) show(loaded);
}

/** The group that the person asked for last; answers about others come too late. */
let wanted = 0;

/** Show what is known of a group, at once; nothing asked or selected stays. @param {number} id */
function turnTo(id) {
	wanted = id;
	resetForGroup();
	show(known(id) ?? null);
}

/** @param {GroupDocument | null} next */
function show(next) {
	asking.cancel();
	document.value = next;
	pending.value = [];
	draft.value = null;
	expected.value = null;
	conflict.value = null;
	if (save.value.state === 'failed') save.value = { state: 'saved', at: null };
}

/** Lay an edit over the group without saving it. @param {Edit} edit */
export function propose(edit) {
	if (draft.value && !sameTarget(draft.value, edit)) settle();
	draft.value = edit;
	if (edit.kind === 'lines') asking.run(edit);
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

/** Save an edit. @param {Edit} edit @returns {Promise<void>} */
export function submit(edit) {
	const at = document.value;
	if (!at) return Promise.resolve();
	draft.value = null;
	pending.value = [...pending.value, edit];
	return queued(at.id, (present) => sendEdit(present, edit), edit);
}

/** @param {GroupDocument} present @param {Edit} edit */
async function sendEdit(present, edit) {
	const { etag, ...rest } = requestOf(present, edit);
	const answer = await client.patch(rest, etag);
	const station = stationOf(present, edit);
	lastStation.value = station === null ? null : { group: present.id, station };
	announce(`${describe(present, edit)}, saved.`);
	return answer;
}

/**
 * The static camera that the last edit on this group changed: its edits have a line of their own,
 * and undo has to ask there.
 */
export const lastStation = signal(/** @type {{group: number, station: number} | null} */ (null));

/** @type {Promise<void>} */
let chain = Promise.resolve();

/**
 * One write after the other: each needs the ETag that the one before has made.
 *
 * @param {number} id
 * @param {(present: GroupDocument) => Promise<GroupDocument>} send
 * @param {Edit | null} [edit]
 * @returns {Promise<void>}
 */
export function queued(id, send, edit = null) {
	writes.value += 1;
	chain = chain.then(() => write(id, send, edit)).finally(() => { writes.value -= 1; });
	return chain;
}

/**
 * @param {number} id
 * @param {(present: GroupDocument) => Promise<GroupDocument>} send
 * @param {Edit | null} edit
 */
async function write(id, send, edit) {
	const present = known(id) ?? (await load(id).catch(() => null));
	// An edit whose predecessor failed was taken back with it.
	if (!present || (edit && document.value?.id === id && !pending.value.includes(edit))) return;
	save.value = { state: 'saving', at: save.value.at };
	try {
		accept(await send(present), edit);
	} catch (error) {
		refuse(id, error, edit);
	}
}

/** @param {GroupDocument} answer @param {Edit | null} edit */
function accept(answer, edit) {
	remember(answer);
	save.value = { state: 'saved', at: Date.now() };
	if (document.value?.id !== answer.id) return;
	document.value = answer;
	pending.value = pending.value.filter((other) => other !== edit);
	if (pending.value.length === 0 && !draft.value) expected.value = null;
}

/** @param {number} id @param {unknown} error @param {Edit | null} edit */
function refuse(id, error, edit) {
	if (!(error instanceof ApiError)) throw error;
	save.value = { state: 'failed', at: save.value.at };
	if (document.value?.id === id) {
		pending.value = [];
		expected.value = null;
		if (error.isConflict && edit && isGroup(error.current)) {
			remember(error.current);
			conflict.value = { edit, theirs: error.current, sentence: error.message };
			return;
		}
	}
	if (isGroup(error.current)) takeOver(error.current);
	complain(`Not saved: ${error.message}`);
}

/** @param {any} body @returns {body is GroupDocument} */
function isGroup(body) {
	return Array.isArray(body?.views);
}

/** Go on from what somebody else made of the group. @param {GroupDocument} theirs */
export function takeOver(theirs) {
	remember(theirs);
	if (document.value?.id === theirs.id) document.value = theirs;
}
