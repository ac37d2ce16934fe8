// @ts-check
/** The calibration editor: one view, its staged lines, and what they would change. */

import { batch, computed, effect, signal } from '@preact/signals';

import * as client from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { latest } from '../lib/latest.js';
import { page, param } from '../lib/router.js';
import { known, load } from './documents.js';
import { applyEdit } from './edits.js';
import { group, groupDocument, onLost, solution, submit } from './group.js';
import { redo as redoSaved, undo as undoSaved } from './undo.js';
import { sameLines } from './line_changes.js';
import { announce, explain } from './notice.js';
import { refuses } from './rights.js';
import { asProposed } from './proposal_lines.js';
import { begin, changesOf, linesOf, overlapOf, proposedLines, rebase, stage, stageEdit, stagings, stepBack, stepForward } from './staging.js';

/** @import {GroupDocument, LinesJson, SolutionJson} from '../api/types.js' */
/** @import {Item} from './outbox.js' */
/** @import {Staging} from './staging.js' */

/** @typedef {{marking: string, index: number | null}} Choice */
/** @typedef {'select' | 'draw' | 'relabel'} Mode */

const INTERVAL = 100;

/** The view in hand: the one in the address bar, else the first. */
export const view = computed(() => {
	const views = group.value?.views ?? [];
	return views.find(({ key }) => key === param('view')) ?? views[0] ?? null;
});

/** The marking in hand, and the point of it. */
export const choice = signal(/** @type {Choice | null} */ (null));
/** The marking under the pointer, in the image or in the diagram. */
export const hovered = signal(/** @type {string | null} */ (null));
export const mode = signal(/** @type {Mode} */ ('select'));
/** The lines while something is dragged. */
export const held = signal(/** @type {LinesJson | null} */ (null));

export const staging = computed(() => {
	const at = view.value;
	if (!at) return begin({});
	const kept = stagings.value[at.station.id];
	return kept ? rebase(kept, at.lines) : begin(at.lines);
});

/** The lines as shown. */
export const lines = computed(() => held.value ?? linesOf(staging.value));
/** What would be sent now. */
export const changes = computed(() => changesOf(stage(staging.value, lines.value, '')));
export const changed = computed(() => Object.keys(changes.value).length > 0);

/** What the server expects of the lines as they are shown. */
const expected = signal(/** @type {{key: string, lines: LinesJson, solution: SolutionJson} | null} */ (null));
/** Why the server cannot say. */
export const refusal = signal('');

/** The group with the staged lines in it. */
export const shown = computed(() => {
	const at = view.value;
	if (!group.value || !at || !changed.value) return group.value;
	return applyEdit(group.value, { kind: 'lines', view: at.key, lines: changes.value });
});

/** The solution that fits the staged lines best: the newest preview, else what is saved. */
export const shownSolution = computed(() => {
	const at = view.value;
	if (!at || !changed.value) return solution.value;
	return expected.value?.key === keyOf(at.station.id) ? expected.value.solution : solution.value;
});

/** Whether the numbers on screen belong to the lines on screen. */
export const isCurrent = computed(() => (
	!changed.value || (expected.value !== null && sameLines(expected.value.lines, lines.value))
));

/** @param {number} station */
function keyOf(station) {
	return `${groupDocument.value?.id} ${station}`;
}

const asking = latest(INTERVAL, async (/** @type {LinesJson} */ wanted, abort) => {
	const [at, id] = [view.value, groupDocument.value?.id];
	if (!at || id === undefined) return;
	const body = { views: { [at.key]: { lines: changes.value } } };
	try {
		const answer = await client.preview(id, body, abort);
		expected.value = { key: keyOf(at.station.id), lines: wanted, solution: answer.solution };
		refusal.value = '';
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		refusal.value = error.message;
	}
});

/** Ask the server about the staged lines for as long as the editor is open. @returns {() => void} */
export function startAsking() {
	const stop = effect(() => {
		const wanted = lines.value;
		if (page.value.page !== 'calibration' || !changed.value) {
			asking.cancel();
			refusal.value = '';
			return;
		}
		asking.run(wanted);
	});
	return () => { stop(); asking.cancel(); };
}

/** @param {Staging} next */
function keep(next) {
	if (view.value) keepOf(view.value.station.id, next);
}

/** @param {number} station @param {Staging} next */
function keepOf(station, next) {
	const { [station]: _, ...rest } = stagings.value;
	stagings.value = next.steps.length > 0 ? { ...rest, [station]: next } : rest;
}

/** Stage lines that differ. @param {LinesJson} next @param {string} label @param {string} [run] */
export function stageLines(next, label, run) {
	held.value = null;
	keep(stage(staging.value, next, label, run));
}

/** Take back the last staged edit; without one, the last saved edit. */
export function undo() {
	if (staging.value.at === 0) {
		undoSaved();
		return;
	}
	announce(`${staging.value.steps[staging.value.at - 1].label}: undone.`);
	keep(stepBack(staging.value));
}

export function redo() {
	if (staging.value.at === staging.value.steps.length) {
		redoSaved();
		return;
	}
	keep(stepForward(staging.value));
	announce(`${staging.value.steps[staging.value.at - 1].label}: redone.`);
}

/** Whether a newer state of the group changes a line that is staged here, to something else. @param {GroupDocument} newer */
export function overlapsStaged(newer) {
	return newer.views.some(({ station, lines: saved }) => {
		const own = stagings.value[station.id];
		return own !== undefined && overlapOf(own, saved).length > 0;
	});
}

/** Forget everything staged for this view. */
export function discardStaged() {
	const at = view.value;
	if (!at) return;
	if (staging.value.steps.length === 0) {
		explain('Nothing is staged.');
		return;
	}
	keep(begin(at.lines));
	held.value = null;
	choice.value = null;
	announce('Staged changes discarded.');
}

/** Save everything staged as one edit. @returns {boolean} whether it is on its way */
export function commit() {
	const at = view.value;
	if (!at || !changed.value) {
		explain('Nothing is staged.');
		return false;
	}
	// What is staged stays where it cannot be saved.
	if (refuses('annotate', groupDocument.value?.dataset.name)) return false;
	const proposed = asProposed(changes.value, proposedLines(staging.value));
	const edit = { kind: /** @type {const} */ ('lines'), view: at.key, lines: changes.value, ...(proposed.length ? { proposed } : {}), staged: true };
	batch(() => {
		held.value = null;
		keep(begin(at.lines));
		submit(edit);
	});
	return true;
}

/** Stage again what was staged here and could not be saved, below what was staged since. @param {Item[]} lost of one group */
async function stageAgain(lost) {
	const edits = lost.flatMap(({ edit }) => (edit?.kind === 'lines' && edit.staged ? [edit] : []));
	if (edits.length === 0) return;
	const [{ group: id }] = lost;
	// Where the group cannot be read there is nothing to stage lines upon.
	const at = known(id) ?? (await load(id).catch(() => null));
	for (const { key, station, lines: saved } of at?.views ?? []) {
		const own = edits.filter((edit) => edit.view === key);
		if (own.length === 0) continue;
		const again = own.reduce((staged, edit) => stageEdit(staged, edit, 'Changes that were not saved'), begin(saved));
		const since = stagings.value[station.id];
		keepOf(station.id, since ? stage(again, linesOf(rebase(since, linesOf(again))), 'Changes since then') : again);
	}
}

onLost(stageAgain);

/** Drop what belongs to one view only. */
export function resetForView() {
	choice.value = null;
	hovered.value = null;
	held.value = null;
	mode.value = 'select';
	refusal.value = '';
}
