import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { centeredOn, fit, toImage, toScreen, zoomAbout } from '../../static/geometry/viewport.js';
import { close } from './scene.mjs';

const image = { width: 1280, height: 720 };
const panel = { width: 640, height: 400 };

describe('fit', () => {
	it('shows the whole image in the middle', () => {
		assert.deepEqual(fit(image, panel), { scale: 0.5, left: 0, top: 20 });
	});
});

describe('toScreen', () => {
	it('puts the centre of the first pixel half a pixel from the corner', () => {
		assert.deepEqual(toScreen({ scale: 8, left: 0, top: 0 }, { x: 0, y: 0 }), { x: 4, y: 4 });
	});

	it('is undone by toImage', () => {
		const viewport = { scale: 3.7, left: -120, top: 33 };
		const back = toImage(viewport, toScreen(viewport, { x: 411.25, y: 87.5 }));
		close([back.x, back.y], [411.25, 87.5]);
	});
});

describe('zoomAbout', () => {
	it('leaves what is under the pointer where it is', () => {
		const before = fit(image, panel);
		const anchor = { x: 200, y: 150 };
		const after = zoomAbout(before, anchor, 2.5, before.scale);
		const [a, b] = [toImage(before, anchor), toImage(after, anchor)];
		close([a.x, a.y], [b.x, b.y]);
	});

	it('goes no farther out than the whole image', () => {
		const before = fit(image, panel);
		assert.equal(zoomAbout(before, { x: 0, y: 0 }, 0.1, before.scale).scale, before.scale);
	});
});

describe('centeredOn', () => {
	it('puts the point into the middle of the panel', () => {
		const { x, y } = toScreen(centeredOn({ x: 900, y: 100 }, panel, 6), { x: 900, y: 100 });
		close([x, y], [320, 200]);
	});
});
