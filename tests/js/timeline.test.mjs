import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { binned, drawCurve, heightOf, toIndex, topOf, toX } from '../../static/views/timeline/drawing.js';

/** A timeline of errors; null is not solved. */
function columnsOf(errors, status = []) {
	const all = errors.map((_, i) => i);
	return {
		total: errors.length, id: all.map((i) => i + 1), number: all, frame: all, error_px: errors,
		passes: errors.map((error) => (error === null ? null : error < 22)), gate: errors.map(() => null),
		status: all.map((i) => status[i] ?? 'unreviewed'), stale: all.map(() => false), sigma_m: errors, point: errors.map(() => null),
	};
}

describe('toX and toIndex', () => {
	it('are inverse wherever a frame has a pixel of its own', () => {
		for (const span of [{ from: 0, to: 99 }, { from: 40, to: 60 }]) {
			for (let i = span.from; i <= span.to; i++) assert.equal(toIndex(span, 700, toX(span, 700, i)), i);
		}
	});

	it('keep a single frame at the start', () => {
		assert.equal(toIndex({ from: 0, to: 0 }, 700, toX({ from: 0, to: 0 }, 700, 0)), 0);
	});
});

describe('drawCurve', () => {
	it('marks what a track leaves out where an edit was made', () => {
		const drawn = [];
		const context = new Proxy({}, {
			get: (_, name) => (...numbers) => { if (name === 'lineTo') drawn.push(numbers); },
			set: () => true,
		});
		const curve = { columns: columnsOf(Array(10).fill(1)), span: { from: 0, to: 9 }, limit: 22, position: -1 };
		const size = { width: 100, height: 60 };
		drawCurve(context, size, curve, {});
		const before = drawn.length;
		drawCurve(context, size, { ...curve, leftOut: new Map([[3, 5], [4, 9000]]) }, {});
		const x = toX(curve.span, 100, 3);
		const marks = drawn.slice(2 * before);
		assert.equal(marks.length, 8);
		assert.deepEqual(marks.slice(0, 4).map(([left]) => left - x), [0, 4, 0, -4]);
		assert.ok(marks.every(([, y]) => y >= 0 && y <= 60));
	});
});

describe('binned', () => {
	it('shows the worst of frames that share a pixel', () => {
		const errors = Array.from({ length: 2000 }, (_, i) => (i === 777 ? 90 : 1));
		const columns = columnsOf(errors, { 777: 'rejected' });
		const bins = [...binned({ columns, span: { from: 0, to: 1999 }, limit: 22, position: 0 }, 300).values()];
		const worst = bins.filter(({ fails }) => fails > 0);
		assert.deepEqual(worst.map((bin) => [bin.worst, bin.status]), [[90, 'rejected']]);
		assert.equal(bins.reduce((sum, { passes, fails, open }) => sum + passes + fails + open, 0), 2000);
	});

	it('draws only what the stretch shows', () => {
		const bins = binned({ columns: columnsOf(Array(100).fill(1)), span: { from: 30, to: 40 }, limit: 22, position: 0 }, 700);
		assert.equal(bins.size, 11);
	});

	it('knows frames that are not solved', () => {
		const [bin] = binned({ columns: columnsOf([null]), span: { from: 0, to: 0 }, limit: 22, position: 0 }, 100).values();
		assert.deepEqual([bin.worst, bin.open, bin.passes, bin.fails], [null, 1, 0, 0]);
	});
});

describe('the scale of errors', () => {
	it('reaches from nothing to the largest, and always shows the limit', () => {
		assert.equal(heightOf(0, 100), 0);
		assert.equal(heightOf(100, 100), 1);
		assert.equal(topOf(columnsOf([1, 2, null]), 22), 44);
		assert.equal(topOf(columnsOf([1, 400]), 22), 400);
	});
});
