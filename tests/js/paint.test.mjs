import assert from 'node:assert/strict';
import { test } from 'node:test';

import { linesOntoPaint, ontoPaint, reachOf } from '../../static/geometry/paint.js';

const ROW = [[100, 50, 0.1], [110, 50, 0.1], [120, 50, 0.1], [300, 50, 0.1], [310, 50, 0.1]];

test('a point goes to the nearest place on its paint, between two places too', () => {
	assert.deepEqual(ontoPaint({ x: 113, y: 54 }, ROW, 16), { x: 113, y: 50 });
	assert.deepEqual(ontoPaint({ x: 96, y: 53 }, ROW, 16), { x: 100, y: 50 });
});

test('paint that is far away, or on the other side of a gap, draws nothing', () => {
	assert.equal(ontoPaint({ x: 113, y: 70 }, ROW, 16), null);
	assert.equal(ontoPaint({ x: 200, y: 50 }, ROW, 16), null);
	assert.equal(ontoPaint({ x: 1, y: 1 }, undefined, 16), null);
});

test('lines move onto their own paint, what has none stays, and a goal is no paint', () => {
	const lines = {
		'Middle line': [{ x: 104, y: 52 }, { x: 500, y: 52 }],
		'Circle central': [{ x: 104, y: 52 }],
		'Goal left crossbar': [{ x: 104, y: 52 }],
	};
	const paint = { 'Middle line': ROW, 'Goal left crossbar': ROW };
	const all = linesOntoPaint(lines, paint, reachOf(1280));
	assert.deepEqual(all.lines['Middle line'], [{ x: 104, y: 50 }, { x: 500, y: 52 }]);
	assert.deepEqual(all.lines['Goal left crossbar'], lines['Goal left crossbar']);
	assert.deepEqual([all.moved, all.left], [[2], 2]);
	const one = linesOntoPaint(lines, paint, reachOf(1280), 'Circle central');
	assert.deepEqual(one.lines, lines);
	assert.deepEqual([one.moved, one.left], [[], 1]);
});
