import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { framesOf, lengthOf, nearestOfPieces, nearestOn, piecesOf } from '../../static/geometry/polyline.js';
import { DASHES, gradeOfJac, gradeOfResidual, residualsOf } from '../../static/geometry/residual.js';
import { close } from './scene.mjs';

const corner = [{ x: 0, y: 0 }, { x: 10, y: 0 }, { x: 10, y: 10 }];

describe('nearestOn', () => {
	it('is the foot of the perpendicular', () => {
		const found = nearestOn(corner, { x: 4, y: 3 });
		assert.deepEqual(found.point, { x: 4, y: 0 });
		close([found.distance, found.along, found.side], [3, 4, 3]);
	});

	it('counts the length of the pieces before', () => {
		close([nearestOn(corner, { x: 12, y: 5 }).along], [15]);
	});

	it('is the end for a point beyond it', () => {
		const { distance, point } = nearestOn(corner, { x: -3, y: -4 });
		assert.deepEqual([distance, point], [5, { x: 0, y: 0 }]);
	});

	it('does not exist on nothing', () => {
		assert.equal(nearestOn([], { x: 0, y: 0 }), null);
	});
});

describe('framesOf', () => {
	it('stand at even distances with normals to the right of travel', () => {
		const found = framesOf([corner], 5);
		assert.deepEqual(found.map(({ point }) => [point.x, point.y]), [[0, 0], [5, 0], [10, 0], [10, 5], [10, 10]]);
		close(Object.values(found[0].normal), [0, 1]);
		close(Object.values(found[4].normal), [-1, 0]);
	});

	it('end at the end', () => {
		close([lengthOf(corner)], [20]);
		assert.deepEqual(framesOf([[{ x: 1, y: 1 }, { x: 1, y: 1 }]], 4), []);
	});
});

describe('residualsOf', () => {
	const fit = {
		marking: 'Middle line', outcome: 'tp', used: true, largest_px: 3, distances_px: [3, 1],
		nearest: [], polyline: [[0, 0], [10, 0]],
	};
	const lines = { 'Middle line': [{ x: 2, y: 4 }, { x: 5, y: 1 }] };

	it('tells the distances of the server while nothing moves', () => {
		assert.equal(residualsOf(lines, [fit], 8, false)[0].largest, 3);
	});

	it('measures against the old camera while something moves', () => {
		assert.equal(residualsOf(lines, [fit], 8, true)[0].largest, 4);
	});

	it('puts the worst first and the unannotated last', () => {
		const other = { ...fit, marking: 'Side line top', largest_px: null, distances_px: [], outcome: 'fp' };
		const names = residualsOf(lines, [other, fit], 8, false).map(({ marking, grade }) => [marking, grade]);
		assert.deepEqual(names, [['Middle line', 'ok'], ['Side line top', 'unseen']]);
	});

	it('grades what the camera cannot see as wrong', () => {
		const lost = { ...fit, outcome: 'fn', distances_px: [], polyline: [] };
		assert.equal(residualsOf(lines, [lost], 8, false)[0].grade, 'bad');
	});
});

describe('grades', () => {
	it('differ in dash as well as in colour', () => {
		const dashes = new Set(Object.values(DASHES).map(String));
		assert.equal(dashes.size, 4);
	});

	it('fail from gamma on and warn from half of it', () => {
		assert.deepEqual([3.9, 4, 8].map((px) => gradeOfResidual(px, 8)), ['ok', 'warn', 'bad']);
	});

	it('do not let a JaC of exactly the limit pass', () => {
		assert.equal(gradeOfJac(0.75, 0.75), 'bad');
	});
});

describe('piecesOf', () => {
	const image = { width: 100, height: 60 };
	// A circle that leaves at the bottom and comes back, as the server clips it.
	const circle = [[20, 40], [30, 50], [36.2, 59], [63.8, 59], [70, 50], [80, 40]].map(([x, y]) => ({ x, y }));

	it('draws nothing along the border between leaving and coming back', () => {
		const pieces = piecesOf(circle, image);
		assert.deepEqual(pieces.map((piece) => piece.length), [3, 3]);
		assert.deepEqual(pieces.flat(), circle);
	});

	it('cuts where a line leaves at one border and comes back at another', () => {
		const corner = [[80, 20], [99, 30], [70, 59], [50, 40]].map(([x, y]) => ({ x, y }));
		assert.deepEqual(piecesOf(corner, image).map((piece) => piece.length), [2, 2]);
	});

	it('leaves a line whole that crosses the image, and one of two points', () => {
		const across = [[0, 10], [50, 20], [99, 30]].map(([x, y]) => ({ x, y }));
		assert.deepEqual(piecesOf(across, image), [across]);
		assert.deepEqual(piecesOf([across[0], across[2]], image), [[across[0], across[2]]]);
		assert.deepEqual(piecesOf([], image), []);
	});

	it('is looked at as one line without the gap', () => {
		const pieces = piecesOf(circle, image);
		assert.equal(framesOf(pieces, 50).length, 50);
		assert.ok(framesOf(pieces, 50).every(({ point }) => point.x <= 36.3 || point.x >= 63.7));
		const end = nearestOfPieces(pieces, { x: 80, y: 40 });
		assert.ok(Math.abs(end.along - (lengthOf(pieces[0]) + lengthOf(pieces[1]))) < 1e-9);
	});
});
