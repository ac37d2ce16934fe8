import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { clipSegment, spreadApart } from '../../static/geometry/spread.js';

const BOX = { left: 0, top: 0, right: 200, bottom: 100 };

describe('spreadApart', () => {
	it('leaves alone what stands apart', () => {
		const places = [{ x: 10, y: 10 }, { x: 60, y: 10 }, { x: 10, y: 80 }];
		assert.deepEqual(spreadApart(places, 16, BOX), places);
	});

	it('moves marks in one place apart, also in a corner and beside a taken place', () => {
		const corner = Array.from({ length: 6 }, () => ({ x: 198, y: 99 }));
		const taken = [{ x: 190, y: 90 }];
		const spread = spreadApart(corner, 16, BOX, taken);
		spread.forEach((a, i) => {
			for (const b of [...spread.slice(i + 1), ...taken]) assert.ok(Math.hypot(a.x - b.x, a.y - b.y) > 15.5);
			assert.ok(a.x <= 200 && a.y <= 100 && a.x >= 0 && a.y >= 0);
		});
	});

	it('moves two that touch no farther than needed', () => {
		const [a, b] = spreadApart([{ x: 50, y: 50 }, { x: 60, y: 50 }], 16, BOX);
		assert.ok(Math.abs(b.x - a.x - 16) < 0.1 && Math.abs(a.x - 47) < 0.1);
	});

	it('puts what lies outside at the border', () => {
		assert.deepEqual(spreadApart([{ x: 400, y: 50 }], 16, BOX), [{ x: 200, y: 50 }]);
	});
});

describe('clipSegment', () => {
	it('ends where the box ends', () => {
		assert.deepEqual(clipSegment({ x: 50, y: 50 }, { x: 350, y: 50 }, BOX), [{ x: 50, y: 50 }, { x: 200, y: 50 }]);
	});

	it('starts where the box starts', () => {
		assert.deepEqual(clipSegment({ x: -100, y: 50 }, { x: 100, y: 50 }, BOX), [{ x: 0, y: 50 }, { x: 100, y: 50 }]);
	});

	it('is nothing beside the box', () => {
		assert.equal(clipSegment({ x: -10, y: -10 }, { x: 300, y: -10 }, BOX), null);
		assert.equal(clipSegment({ x: 0, y: 300 }, { x: 300, y: 120 }, BOX), null);
	});
});
