import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { behindText, opens, pointAt } from '../../static/views/evaluation/figure_points.js';
import { colourOf, stepsOf } from '../../static/views/evaluation/figure_scale.js';
import { readSize } from '../../static/views/evaluation/image_size.js';

const series = (more) => ({ name: 'a', label: 'A', kind: 'line', x: [], y: [], low: [], high: [], count: [], color: null, group_id: null, frames: [], ...more });
const panel = (...every) => ({ title: '', x: { label: 'Distance', unit: 'm', low: 0, high: null }, y: { label: 'Error', unit: 'm', low: 0, high: null }, series: every, marks: [], color: null });
const selections = (...bounds) => bounds.map(([low, high]) => ({ field: 'distance_m', low, high }));

describe('a click in a figure', () => {
	const median = series({ name: 'median', x: [25, 55], y: [1, 5], count: [4, 3], frames: selections([20, 30], [50, 60]) });
	const cloud = series({ name: 'frames', kind: 'points', x: [54.9, 55.1, 70], y: [1, 9, 2], frames: selections([54.9, 54.91], [55.1, 55.11], [70, 70.1]) });
	const binned = panel(cloud, median);

	it('on a median means its bin, though frames stand beside it', () => {
		assert.deepEqual(pointAt(binned, 54.9, 5.1), { series: median, place: 1 });
		assert.equal(behindText(binned, median, 1), 'Distance 50 to 60 m, 3 with an error');
	});

	it('on a frame means that frame', () => {
		assert.deepEqual(pointAt(binned, 54.9, 8.8), { series: cloud, place: 1 });
		assert.deepEqual(pointAt(binned, 54.9, 1.1), { series: cloud, place: 0 });
	});

	it('on a curve without frames opens nothing of another curve', () => {
		const own = series({ name: 'own', x: [0, 1], y: [0.9, 0.8], frames: selections([0, null], [1, null]) });
		const other = series({ name: 'other', x: [0, 1], y: [0.5, 0.4] });
		assert.equal(pointAt(panel(own, other), 1, 0.42)?.series, other);
		assert.deepEqual([opens(own), opens(other), opens({ ...other, frames: undefined }), opens({ ...other, group_id: 3 })], [true, false, false, true]);
	});

	it('in an empty figure means nothing', () => {
		assert.equal(pointAt(panel(series({})), 0, 0), null);
	});
});

describe('the scale of a figure', () => {
	const every = [10, 30, 50, 90].map((color) => series({ color }));
	const coloured = { ...panel(...every), color: { label: 'Distance', unit: 'm', low: null, high: null } };

	it('names its steps in order, and each curve has the colour of its step', () => {
		const steps = stepsOf(coloured);
		assert.deepEqual(steps.map(({ low, high }) => [low, high]), [[10, 30], [30, 50], [50, 70], [70, 90]]);
		assert.deepEqual(every.map((one, index) => colourOf(one, index, coloured)), [0, 1, 2, 3].map((step) => steps[step].colour));
	});

	it('of one distance has one step', () => {
		assert.equal(stepsOf(panel(series({ color: 4 }))).length, 1);
	});
});

describe('the size of images', () => {
	it('is read as people write it', () => {
		for (const text of ['1280x720', ' 1280 × 720 ', '1280,720']) assert.deepEqual(readSize(text, 'Image size'), { size: [1280, 720], problem: '' });
		assert.deepEqual(readSize('  ', 'Image size'), { size: null, problem: '' });
	});

	it('says what is wrong', () => {
		assert.match(readSize('720p', 'Image size').problem, /^Image size: write width x height/);
		assert.match(readSize('1280x1', 'Image size').problem, /each side is 2 to 16,384/);
	});
});
