import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { conflictOf } from '../../static/state/conflict.js';

const line = [{ x: 1, y: 2 }, { x: 3, y: 4 }];
const moved = [{ x: 1, y: 2 }, { x: 3, y: 9 }];
const ball = { box: [10, 10, 4, 4], point: null, occluded: false, out_of_view: false };
const view = { id: 1, key: '7.png', letter: 'A', included: true, lines: { 'Middle line': line }, balls: [ball] };
const none = { state: 'unreviewed', reason: null, note: null };
const base = { lines: view.lines, balls: view.balls, included: true, verdict: none };
const group = { id: 5, views: [view], verdict: none };

function item(edit, from = base) {
	return { id: 'x', group: 5, edit, verdict: null, base: from };
}

const lineEdit = (points) => ({ kind: 'lines', view: '7.png', lines: { 'Middle line': points } });

describe('conflictOf', () => {
	it('sees that they changed something else', () => {
		const theirs = { ...group, views: [{ ...view, balls: [] }] };
		const { fields } = conflictOf(theirs, [item(lineEdit(moved))]);
		assert.deepEqual(fields.map(({ name, overlaps }) => [name, overlaps]), [['Middle line of A', false]]);
	});

	it('sees that they moved the same line elsewhere', () => {
		const theirs = { ...group, views: [{ ...view, lines: { 'Middle line': [{ x: 0, y: 0 }] } }] };
		const [field] = conflictOf(theirs, [item(lineEdit(moved))]).fields;
		assert.ok(field.overlaps);
		assert.deepEqual([field.base, field.mine], [{ points: line, hidden: false }, { points: moved, hidden: false }]);
	});

	it('does not call the same change an overlap', () => {
		const theirs = { ...group, views: [{ ...view, lines: { 'Middle line': moved } }] };
		assert.ok(!conflictOf(theirs, [item(lineEdit(moved))]).fields[0].overlaps);
	});

	it('takes the last of several edits of one thing, and the first one\'s base', () => {
		const second = { ...base, lines: { 'Middle line': moved } };
		const { fields } = conflictOf(group, [item(lineEdit(moved)), item(lineEdit(null), second)]);
		assert.equal(fields.length, 1);
		assert.deepEqual([fields[0].base.points, fields[0].mine.points], [line, null]);
	});

	it('knows that there was nothing before the first of several edits of one thing', () => {
		const empty = { ...group, views: [{ ...view, lines: {} }] };
		const { fields } = conflictOf(empty, [item(lineEdit(line), { ...base, lines: {} }), item(lineEdit(moved))]);
		assert.deepEqual([fields[0].base.points, fields[0].overlaps], [null, false]);
	});

	it('tells a marking that is not visible from one that is not drawn', () => {
		const empty = { ...group, views: [{ ...view, lines: {} }] };
		const mine = { ...lineEdit(null), notVisible: ['Middle line'] };
		const { fields } = conflictOf(empty, [item(mine, { ...base, lines: {} })]);
		assert.deepEqual([fields[0].mine.hidden, fields[0].theirs.hidden, fields[0].overlaps], [true, false, false]);
		assert.deepEqual(fields[0].edit, mine);
		const theirs = { ...group, views: [{ ...view, lines: {}, not_visible: ['Middle line'] }] };
		assert.ok(conflictOf(theirs, [item(lineEdit(moved), { ...base, lines: {} })]).fields[0].overlaps);
	});

	it('says of each marking whether it is as it was proposed', () => {
		const lines = { 'Middle line': moved, 'Side line top': line };
		const mine = { kind: 'lines', view: '7.png', lines, proposed: ['Side line top'] };
		const [middle, side] = conflictOf(group, [item(mine)]).fields;
		assert.deepEqual(middle.edit, lineEdit(moved));
		assert.deepEqual(side.edit, { ...lineEdit(line), lines: { 'Side line top': line }, proposed: ['Side line top'] });
	});

	it('can be merged when a part of mine overlaps and a part does not', () => {
		const theirs = { ...group, views: [{ ...view, balls: [{ ...ball, box: [0, 0, 4, 4] }] }] };
		const mine = [item(lineEdit(moved)), item({ kind: 'ball', view: '7.png', ball: null })];
		const { fields, mergeable } = conflictOf(theirs, mine);
		assert.deepEqual(fields.map(({ overlaps }) => overlaps), [false, true]);
		assert.ok(mergeable);
	});

	it('compares the reasons of two who left out the same view', () => {
		const mine = { kind: 'include', view: '7.png', included: false, reason: 'duplicate_view' };
		const left = (reason) => ({ ...group, views: [{ ...view, included: false, left_out: { reason, note: null } }] });
		assert.ok(conflictOf(left('not_same_instant'), [item(mine)]).fields[0].overlaps);
		assert.ok(!conflictOf(left('duplicate_view'), [item(mine)]).fields[0].overlaps);
	});

	it('holds a verdict against theirs', () => {
		const theirs = { ...group, verdict: { ...none, state: 'accepted' } };
		const verdict = { state: 'rejected', reason: 'other', note: 'x' };
		const [field] = conflictOf(theirs, [{ ...item(null), verdict }]).fields;
		assert.deepEqual([field.name, field.overlaps], ['Verdict', true]);
	});

	it('says beside a verdict what they changed of the views that it found', () => {
		const verdict = { state: 'accepted', reason: null, note: null };
		const found = { ...base, views: { '7.png': base } };
		const theirs = { ...group, views: [{ ...view, station: {}, lines: { 'Middle line': moved }, balls: [{ ...ball, occluded: true }] }] };
		const { fields, mergeable } = conflictOf(theirs, [{ ...item(null, found), verdict }]);
		assert.deepEqual(fields.map(({ name, unchanged = false }) => [name, unchanged]), [['Verdict', false], ['Ball of A', true], ['Middle line of A', true]]);
		assert.ok(!mergeable);
		assert.ok(fields.slice(1).every(({ edit, verdict: own }) => edit === null && own === null));
		assert.equal(conflictOf({ ...group, views: [{ ...view, station: {} }] }, [{ ...item(null, found), verdict }]).fields.length, 1);
	});

	it('drops what was said about a view that is gone', () => {
		assert.deepEqual(conflictOf({ ...group, views: [] }, [item(lineEdit(moved))]).fields, []);
	});
});
