import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

import { actions, did, didAgain, forget, forgetEdit, forgetUndone, nextAgain, nextBack, tookBack, undone, withAction } from '../../static/state/last_action.js';

const edit = (group) => ({ kind: 'edit', dataset: 'a', group, number: group, times: 1 });
const verdict = (group) => ({ kind: 'verdict', dataset: 'a', group, number: group, given: {}, before: {} });
const batch = { kind: 'batch', dataset: 'a', batch: 3, text: '3 groups deferred' };

describe('withAction', () => {
	it('counts edits of one group in a row, and keeps the last hundred', () => {
		assert.deepEqual(withAction([edit(1)], edit(1)), [{ ...edit(1), times: 2 }]);
		assert.deepEqual(withAction([edit(1)], edit(2)), [edit(1), edit(2)]);
		const many = Array.from({ length: 100 }, (_, number) => verdict(number));
		const after = withAction(many, verdict(100));
		assert.deepEqual([after.length, after[0].group, after.at(-1).group], [100, 1, 100]);
	});
});

describe('nextBack', () => {
	it('is what was done last, wherever that was', () => {
		assert.equal(nextBack([verdict(1), batch], 2, true, 'a'), batch);
		assert.deepEqual(nextBack([edit(1), verdict(1)], 2, true, 'a'), verdict(1));
		assert.equal(nextBack([verdict(1), edit(2)], 2, true, 'a'), 'here');
	});

	it('is a run of followed balls as a whole, though the group on screen has one of them', () => {
		const run = { kind: 'follow', dataset: 'a', from: '106', text: '14 balls followed', items: [] };
		assert.equal(nextBack([edit(2), run], 2, true, 'a'), run);
	});

	it('is the edit of the group on screen before one elsewhere', () => {
		assert.equal(nextBack([edit(1)], 2, true, 'a'), 'here');
		assert.deepEqual(nextBack([edit(1)], 2, false, 'a'), edit(1));
	});

	it('passes over edits that cannot be taken back any more', () => {
		assert.deepEqual(nextBack([verdict(1), edit(2)], 2, false, 'a'), verdict(1));
		assert.equal(nextBack([edit(2)], 2, false, 'a'), null);
	});

	it('is nothing of another dataset', () => {
		const elsewhere = { ...verdict(9), dataset: 'b' };
		assert.deepEqual(nextBack([verdict(1), elsewhere], null, false, 'a'), verdict(1));
		assert.equal(nextBack([elsewhere, { ...batch, dataset: 'b' }], null, false, 'a'), null);
		assert.equal(nextBack([elsewhere, { ...edit(2), dataset: 'b' }], 1, true, 'a'), 'here');
		assert.deepEqual(nextAgain([verdict(1), elsewhere], 'a'), verdict(1));
		assert.equal(nextAgain([elsewhere], 'a'), undefined);
	});

	it('is the last edit of a group where this window has done nothing', () => {
		assert.equal(nextBack([], 2, true, 'a'), 'here');
		assert.equal(nextBack([], 2, false, 'a'), null);
	});
});

describe('actions', () => {
	beforeEach(() => { actions.value = []; });

	it('are forgotten one by one, edits one at a time', () => {
		for (const action of [edit(1), edit(1), batch, verdict(2)]) did(action);
		forgetEdit(1);
		assert.deepEqual(actions.value, [edit(1), batch, verdict(2)]);
		forgetEdit(1);
		forget({ ...batch });
		assert.deepEqual(actions.value, [verdict(2)]);
		forget(actions.value[0]);
		assert.deepEqual(actions.value, []);
	});
});

describe('what was taken back', () => {
	it('is done again in turn, until something else is done', () => {
		actions.value = [];
		tookBack(edit(1));
		tookBack(verdict(2));
		didAgain(undone.value.at(-1));
		assert.deepEqual([actions.value, undone.value], [[verdict(2)], [edit(1)]]);
		did(verdict(3));
		assert.deepEqual(undone.value, []);
		didAgain(edit(1));
		assert.deepEqual(actions.value, [verdict(2), verdict(3)]);
	});

	it('is a batch under its new number once it was given again', () => {
		actions.value = [];
		undone.value = [];
		tookBack(batch);
		didAgain(batch, { ...batch, batch: 4 });
		assert.deepEqual([actions.value, undone.value], [[{ ...batch, batch: 4 }], []]);
		tookBack(batch);
		forgetUndone({ ...batch });
		assert.deepEqual(undone.value, []);
	});
});
