import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import {
	changesBetween, relabelled, sidesSwapped, withAdded, withInserted, withoutMarking, withoutPoint, withPoint,
} from '../../static/state/line_changes.js';
import { begin, changesOf, linesOf, overlapOf, rebase, stage, stepBack, stepForward } from '../../static/state/staging.js';

const LINES = {
	'Middle line': [{ x: 10, y: 0 }, { x: 10, y: 50 }, { x: 10, y: 100 }],
	'Side line left': [{ x: 0, y: 0 }, { x: 0, y: 90 }],
};

describe('line changes', () => {
	it('move one point and share everything else', () => {
		const next = withPoint(LINES, 'Middle line', 1, { x: 12, y: 51 });
		assert.deepEqual(next['Middle line'][1], { x: 12, y: 51 });
		assert.equal(next['Side line left'], LINES['Side line left']);
		assert.deepEqual(LINES['Middle line'][1], { x: 10, y: 50 });
	});

	it('drop a marking with its last point', () => {
		const once = withoutPoint(LINES, 'Side line left', 0);
		assert.equal(once['Side line left'].length, 1);
		assert.ok(!('Side line left' in withoutPoint(once, 'Side line left', 0)));
		assert.deepEqual(Object.keys(withoutMarking(LINES, 'Middle line')), ['Side line left']);
	});

	it('insert where told, and add where the line grows least', () => {
		assert.deepEqual(withInserted(LINES, 'Middle line', 1, { x: 1, y: 2 })['Middle line'][1], { x: 1, y: 2 });
		assert.equal(withAdded(LINES, 'Middle line', { x: 10, y: 70 }).index, 2);
		assert.equal(withAdded(LINES, 'Middle line', { x: 10, y: 130 }).index, 3);
		assert.equal(withAdded(LINES, 'Circle left', { x: 1, y: 1 }).lines['Circle left'].length, 1);
	});

	it('give points another name, joining what is there', () => {
		const next = relabelled(LINES, 'Side line left', 'Middle line');
		assert.equal(next['Middle line'].length, 5);
		assert.ok(!('Side line left' in next));
		assert.equal(relabelled(LINES, 'Middle line', 'Middle line'), LINES);
	});

	it('swap sides, and twice is nothing', () => {
		const swapped = sidesSwapped(LINES);
		assert.deepEqual(Object.keys(swapped), ['Middle line', 'Side line right']);
		assert.deepEqual(changesBetween(LINES, sidesSwapped(swapped)), {});
	});

	it('say what is new, what differs and what is gone', () => {
		const next = { 'Middle line': LINES['Middle line'].slice(1), 'Circle left': [{ x: 1, y: 1 }] };
		assert.deepEqual(changesBetween(LINES, next), {
			'Side line left': null, 'Middle line': next['Middle line'], 'Circle left': next['Circle left'],
		});
	});
});

describe('staging', () => {
	const moved = withPoint(LINES, 'Middle line', 0, { x: 11, y: 0 });
	const fewer = withoutMarking(moved, 'Side line left');

	it('collects several edits into one change', () => {
		const staging = stage(stage(begin(LINES), moved, 'moved'), fewer, 'deleted');
		assert.deepEqual(changesOf(staging), { 'Middle line': moved['Middle line'], 'Side line left': null });
		assert.equal(staging.steps.length, 2);
	});

	it('goes back and forth, and a new step ends what was taken back', () => {
		const two = stage(stage(begin(LINES), moved, 'moved'), fewer, 'deleted');
		const one = stepBack(two);
		assert.equal(linesOf(one), moved);
		assert.equal(linesOf(stepForward(one)), fewer);
		assert.equal(linesOf(stepBack(stepBack(stepBack(two)))), LINES);
		assert.equal(stage(one, LINES, 'back by hand').steps.length, 2);
	});

	it('takes nudges of one point as one step', () => {
		let staging = begin(LINES);
		for (let x = 11; x < 15; x++) staging = stage(staging, withPoint(LINES, 'Middle line', 0, { x, y: 0 }), 'nudge', 'a');
		assert.equal(staging.steps.length, 1);
		staging = stage(staging, withPoint(LINES, 'Middle line', 1, { x: 1, y: 0 }), 'nudge', 'b');
		assert.equal(staging.steps.length, 2);
	});

	it('stages nothing that changes nothing', () => {
		assert.equal(stage(begin(LINES), structuredClone(LINES), 'same').steps.length, 0);
	});

	it('keeps its own changes on top of what somebody else saved', () => {
		const theirs = { ...LINES, 'Side line left': [{ x: 5, y: 5 }, { x: 6, y: 6 }], 'Circle left': [{ x: 1, y: 1 }] };
		const merged = rebase(stage(begin(LINES), moved, 'moved'), theirs);
		assert.deepEqual(changesOf(merged), { 'Middle line': moved['Middle line'] });
		assert.deepEqual(linesOf(merged)['Side line left'], theirs['Side line left']);
		assert.equal(rebase(begin(LINES), theirs).steps.length, 0);
	});

	it('has nothing left when somebody else saved the same', () => {
		assert.deepEqual(changesOf(rebase(stage(begin(LINES), moved, 'moved'), moved)), {});
	});
});

describe('a newer saved state', () => {
	const moved = (/** @type {number} */ x) => withPoint(LINES, 'Middle line', 1, { x, y: 51 });

	it('overlaps where both changed a marking, to something else', () => {
		const own = stage(begin(LINES), moved(12), 'moved');
		assert.deepEqual(overlapOf(own, moved(13)), ['Middle line']);
		assert.deepEqual(overlapOf(own, withoutMarking(LINES, 'Middle line')), ['Middle line']);
		assert.deepEqual(overlapOf(own, moved(12)), []);
		assert.deepEqual(overlapOf(own, withoutMarking(LINES, 'Side line left')), []);
		assert.deepEqual(overlapOf(begin(LINES), moved(13)), []);
	});
});
