// @ts-check
/** Somebody else was first: whose edit counts, field by field. */

import { batch, computed } from '@preact/signals';

import { leftOutBy, viewOf } from './edits.js';
import { groupDocument, submit, submitDismissal, submitVerdict } from './group.js';
import { announce } from './notice.js';
import { discard, outbox } from './outbox.js';

/** @import {GroupDocument, PointJson, ViewJson} from '../api/types.js' */
/** @import {BallEdit, Edit, LinesEdit} from './edits.js' */
/** @import {FindingName} from './last_action.js' */
/** @import {Base, Item, Verdict} from './outbox.js' */

/**
 * @typedef {object} Field one thing that both could have changed
 * @property {string} key
 * @property {'verdict' | Edit['kind']} kind
 * @property {string} name in words
 * @property {string | null} view
 * @property {unknown} base what both found
 * @property {unknown} mine
 * @property {unknown} theirs as it is now
 * @property {boolean} overlaps whether they changed it too, to something else
 * @property {boolean} [unchanged] I changed nothing of it, only they did
 * @property {Edit | null} edit that makes mine of theirs
 * @property {Verdict | null} verdict
 */
/** @typedef {{fields: Field[], mergeable: boolean}} Conflict */
/** @typedef {{points: PointJson[] | null, hidden: boolean}} Marked one marking: its points, or that the picture does not show it */

/** Writes of any group that wait for the person. */
export const held = computed(() => outbox.value.filter((item) => item.held));

/** What is to be decided about the group on screen; null when nothing. */
export const conflict = computed(() => {
	const theirs = groupDocument.value;
	const own = theirs ? held.value.filter(({ group }) => group === theirs.id) : [];
	return theirs && own.length ? conflictOf(theirs, own) : null;
});

/** @param {GroupDocument} theirs @param {Item[]} own @returns {Conflict} */
export function conflictOf(theirs, own) {
	/** @type {Map<string, Field>} */
	const fields = new Map();
	for (const item of own) {
		for (const field of fieldsOf(theirs, item)) {
			// Of several edits of one thing the first knows what was there and the last what I want.
			const first = fields.get(field.key);
			const base = first ? first.base : field.base;
			fields.set(field.key, { ...field, base, overlaps: overlap(base, field.mine, field.theirs) });
		}
	}
	const mine = [...fields.values()];
	const apart = mine.filter(({ overlaps }) => !overlaps).length;
	const base = own.find(({ base }) => base?.views)?.base?.views ?? {};
	const others = theirs.views.flatMap((view) => (base[view.key] ? theirChanges(view, base[view.key]) : []));
	return {
		fields: [...mine, ...others.filter(({ key }) => !fields.has(key))], mergeable: apart > 0 && apart < mine.length,
	};
}

/** What they changed of a view that a verdict had found otherwise. @param {ViewJson} view @param {Base} base @returns {Field[]} */
function theirChanges(view, base) {
	const markings = [...new Set([base, view].flatMap(({ lines, not_visible = [] }) => [...Object.keys(lines), ...not_visible]))];
	const edits = /** @type {Edit[]} */ ([
		{ kind: 'include', view: view.key, included: base.included, reason: base.left_out?.reason, note: base.left_out?.note },
		{ kind: 'ball', view: view.key, ball: base.balls[0] ?? null },
		{ kind: 'picture', view: view.key, picture: base.picture ?? null },
		{ kind: 'lines', view: view.key, lines: Object.fromEntries(markings.map((marking) => [marking, base.lines[marking] ?? null])), notVisible: base.not_visible },
	]);
	return edits.flatMap((edit) => editFields(view, edit, base))
		.filter((field) => !same(field.base, field.theirs))
		.map((field) => ({ ...field, edit: null, unchanged: true, mine: field.base }));
}

/** @param {GroupDocument} theirs @param {Item} item @returns {Field[]} */
function fieldsOf(theirs, { edit, verdict, base }) {
	if (verdict) {
		const { state, reason, note } = theirs.verdict;
		return [{
			...BLANK, key: 'verdict', name: 'Verdict', verdict, mine: verdict,
			base: pick(base?.verdict), theirs: { state, reason, note },
		}];
	}
	if (!edit || !theirs.views.some(({ key }) => key === edit.view)) return [];
	return editFields(viewOf(theirs, edit.view), edit, base);
}

/** @param {ViewJson} view theirs @param {Edit} edit mine @param {Base | null} base @returns {Field[]} */
function editFields(view, edit, base) {
	const about = { ...BLANK, kind: edit.kind, view: edit.view };
	if (edit.kind === 'include') {
		return [{
			...about, key: `include ${view.key}`, name: `View ${view.letter} used`, edit,
			base: base && { included: base.included, left_out: base.left_out ?? null },
			mine: { included: edit.included, left_out: leftOutBy(edit) },
			theirs: { included: view.included, left_out: view.left_out ?? null },
		}];
	}
	if (edit.kind === 'ball') {
		return [{
			...about, key: `ball ${view.key}`, name: `Ball of ${view.letter}`, edit: insisting(edit),
			base: base?.balls, mine: edit.ball ? [edit.ball] : [], theirs: view.balls,
		}];
	}
	if (edit.kind === 'picture') {
		return [{
			...about, key: `picture ${view.key}`, name: `Shape of the picture of ${view.letter}`, edit,
			base: base?.picture ?? null, mine: edit.picture, theirs: view.station.picture ?? null,
		}];
	}
	return Object.keys(edit.lines).map((marking) => ({
		...about, key: `line ${view.key} ${marking}`, name: `${marking} of ${view.letter}`, edit: onlyOf(edit, marking),
		base: marked(marking, base?.lines, base?.not_visible), mine: marked(marking, edit.lines, edit.notVisible),
		theirs: marked(marking, view.lines, view.not_visible),
	}));
}

/**
 * @param {string} marking @param {Record<string, PointJson[] | null> | undefined} lines
 * @param {string[] | undefined} hidden markings that the picture does not show @returns {Marked}
 */
function marked(marking, lines, hidden) {
	return { points: lines?.[marking] ?? null, hidden: hidden?.includes(marking) ?? false };
}

/** What an edit says of one marking. @param {LinesEdit} edit @param {string} marking @returns {LinesEdit} */
function onlyOf({ lines, proposed, notVisible, ...rest }, marking) {
	return {
		...rest, lines: { [marking]: lines[marking] }, ...(proposed?.includes(marking) ? { proposed: [marking] } : {}),
		...(notVisible?.includes(marking) ? { notVisible: [marking] } : {}),
	};
}

/** The same edit, whatever ball they have put there. @param {BallEdit} edit @returns {BallEdit} */
function insisting(edit) {
	return edit.prediction ? { ...edit, prediction: { ...edit.prediction, replace: true } } : edit;
}

/** @type {Field} */
const BLANK = {
	key: '', kind: 'verdict', name: '', view: null, base: null, mine: null, theirs: null, overlaps: false,
	edit: null, verdict: null,
};

/** @param {Verdict | undefined} verdict */
function pick(verdict) {
	return verdict && { state: verdict.state, reason: verdict.reason, note: verdict.note };
}

/** @param {unknown} base @param {unknown} mine @param {unknown} theirs */
function overlap(base, mine, theirs) {
	return !same(base, theirs) && !same(mine, theirs);
}

/** @param {unknown} a @param {unknown} b */
function same(a, b) {
	return JSON.stringify(a) === JSON.stringify(b);
}

/** Make my edits again on top of theirs. */
export function keepMine() {
	resolve((field) => !same(field.mine, field.theirs), 'Your version is kept.');
}

/** Keep mine where they changed nothing; where both changed the same, theirs stays. */
export function mergeBoth() {
	resolve((field) => !field.overlaps && !same(field.mine, field.theirs), 'Merged. Where both changed the same, their version was kept.');
}

/** Drop my edits and go on with theirs. */
export function takeTheirs() {
	resolve(() => false, 'Your edit was discarded.');
}

/** @param {(field: Field) => boolean} wanted @param {string} said */
function resolve(wanted, said) {
	const present = conflict.value;
	const id = groupDocument.value?.id;
	if (!present) return;
	// What was said of findings meanwhile was no part of the choice.
	const dismissals = held.value.filter((item) => item.group === id && item.path.endsWith('/dismissal'));
	batch(() => {
		discard((item) => item.held && item.group === id);
		for (const field of present.fields.filter(wanted)) {
			if (field.edit) submit(field.edit);
			if (field.verdict) submitVerdict(field.verdict);
		}
		for (const { body } of dismissals) {
			const { dismissed, ...finding } = /** @type {FindingName & {dismissed: boolean}} */ (body);
			submitDismissal(finding, dismissed);
		}
	});
	announce(said);
}
