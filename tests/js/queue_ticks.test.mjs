import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

import { activeRow, queue } from '../../static/state/queue.js';
import {
	clearTicks, countOf, extendTicks, isTicked, NONE, queryOf, tickTo, ticks, turnAll, turnTick, withRows,
} from '../../static/state/queue_ticks.js';

const ROWS = Array.from({ length: 9 }, (_, place) => ({ id: 100 + place }));
const ticked = () => ROWS.map(({ id }) => id).filter((id) => isTicked(ticks.value, id));
/** @param {string} q */
const show = (q) => { queue.value = { ...queue.value, dataset: 'd', q, shown: `d ${q}`, pages: new Map([[0, ROWS]]), total: ROWS.length, loaded: true }; };

describe('withRows', () => {
	it('ticks and unticks, whether few or nearly all are ticked', () => {
		const some = withRows(NONE, [1, 2], true);
		assert.deepEqual([isTicked(some, 1), isTicked(some, 3), countOf(some, 10)], [true, false, 2]);
		const most = withRows({ all: true, ids: new Set() }, [1, 2], false);
		assert.deepEqual([isTicked(most, 1), isTicked(most, 3), countOf(most, 10)], [false, true, 8]);
		assert.equal(countOf(withRows(most, [2], true), 10), 9);
		assert.equal(countOf(withRows(some, [1], false), 10), 1);
	});
});

describe('queryOf', () => {
	it('names the ticked groups, or what is left out of all that match', () => {
		assert.equal(queryOf(withRows(NONE, [19, 3], true), ''), 'id:3,19');
		assert.equal(queryOf(withRows(NONE, [19], true), 'id:3,19'), 'id:3,19 id:19');
		assert.equal(queryOf({ all: true, ids: new Set() }, 'jac<0.5 sort:jac'), 'jac<0.5');
		assert.equal(queryOf({ all: true, ids: new Set([19, 3]) }, 'jac<0.5 sort:jac'), 'jac<0.5 -id:3,19');
		assert.equal(queryOf({ all: true, ids: new Set([3]) }, 'id:3,4,5'), 'id:3,4,5 -id:3');
	});
});

describe('queryOf a list that goes on changing', () => {
	it('leaves ticked rows alone that do not match any more', () => {
		assert.equal(queryOf(withRows(NONE, [19, 3], true), 'status:unreviewed sort:jac'), 'status:unreviewed id:3,19');
	});
});

describe('ranges', () => {
	beforeEach(() => {
		show('');
		clearTicks();
	});

	it('give every row from the last tick on what that one got', async () => {
		turnTick(2);
		await tickTo(5);
		assert.deepEqual(ticked(), [102, 103, 104, 105]);
		await tickTo(1);
		assert.deepEqual(ticked(), [101, 102]);
		turnTick(1);
		await tickTo(2);
		assert.deepEqual(ticked(), []);
	});

	it('grow and shrink with the active row', async () => {
		activeRow.value = 3;
		for (const step of [1, 1, -1]) extendTicks(step);
		await Promise.resolve();
		assert.deepEqual([ticked(), activeRow.value], [[103, 104], 4]);
		activeRow.value = 7;
		extendTicks(1);
		extendTicks(1);
		await Promise.resolve();
		assert.deepEqual([ticked(), activeRow.value], [[103, 104, 107, 108], 8]);
	});

	it('begin anew when another group stands where they began', async () => {
		turnTick(2);
		queue.value = { ...queue.value, pages: new Map([[0, ROWS.toReversed()]]) };
		await tickTo(0);
		assert.deepEqual(ticked(), [102, 108]);
	});
});

describe('turnAll', () => {
	it('ticks all that match, then nothing', () => {
		show('');
		clearTicks();
		turnTick(0);
		turnAll();
		assert.equal(countOf(ticks.value, queue.value.total), 9);
		turnTick(0);
		assert.deepEqual(ticked().length, 8);
		turnAll();
		turnAll();
		assert.equal(ticks.value, NONE);
	});
});

describe('ticks', () => {
	it('stay when the order changes, and go with what matched', () => {
		show('jac<0.5');
		turnTick(0);
		show('jac<0.5 sort:jac');
		assert.equal(countOf(ticks.value, 9), 1);
		queue.value = { ...queue.value, q: 'jac<0.7' };
		assert.equal(countOf(ticks.value, 9), 1);
		show('jac<0.7');
		assert.equal(countOf(ticks.value, 9), 0);
	});
});
