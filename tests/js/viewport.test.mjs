import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { centeredOn, fill, fit, inPanel, pan, toImage, toScreen, zoomAbout } from '../../static/geometry/viewport.js';
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
		const after = zoomAbout(before, anchor, 2.5, image, panel);
		const [a, b] = [toImage(before, anchor), toImage(after, anchor)];
		close([a.x, a.y], [b.x, b.y]);
	});

	it('goes no farther out than the whole image', () => {
		const before = fit(image, panel);
		assert.equal(zoomAbout(before, { x: 0, y: 0 }, 0.1, image, panel).scale, before.scale);
	});
});

/** Share of the panel that shows the image. */
function covered({ scale, left, top }, on = panel) {
	const span = (start, size, room) => Math.max(0, Math.min(room, start + size * scale) - Math.max(0, start));
	return (span(left, image.width, on.width) * span(top, image.height, on.height)) / (on.width * on.height);
}

describe('the picture stays in sight', () => {
	const high = { width: 400, height: 800 };

	it('when the wheel turns over a black bar', () => {
		for (const anchor of [{ x: 200, y: 5 }, { x: 10, y: 795 }, { x: 390, y: 100 }]) {
			let view = fit(image, high);
			for (let i = 0; i < 40; i++) {
				const before = covered(view, high);
				view = zoomAbout(view, anchor, 1.12, image, high);
				assert.ok(covered(view, high) >= before - 1e-9, `step ${i} at ${anchor.x}, ${anchor.y}`);
			}
			assert.ok(covered(view, high) > 0.999);
		}
	});

	it('when it is zoomed in at a corner and out at another', () => {
		let view = fit(image, panel);
		for (let i = 0; i < 20; i++) view = zoomAbout(view, { x: 5, y: 25 }, 1.2, image, panel);
		for (let i = 0; i < 40; i++) view = zoomAbout(view, { x: 635, y: 395 }, 0.85, image, panel);
		close([view.scale, view.left, view.top], [0.5, 0, 20]);
	});

	it('however far it is dragged', () => {
		for (const scale of [1, 2, 8]) {
			for (const [dx, dy] of [[9e4, 0], [-9e4, 9e4], [0, -9e4]]) {
				const moved = pan(centeredOn({ x: 640, y: 360 }, panel, scale), dx, dy, image, panel);
				const middle = toImage(moved, { x: panel.width / 2, y: panel.height / 2 });
				assert.ok(middle.x >= -0.51 && middle.x <= 1279.6 && middle.y >= -0.51 && middle.y <= 719.6);
			}
		}
	});

	it('in a panel of another size, its middle where it was', () => {
		const view = centeredOn({ x: 300, y: 200 }, panel, 4);
		const there = inPanel(view, panel, image, high);
		const middle = toScreen(there, { x: 300, y: 200 });
		close([middle.x, middle.y], [200, 400]);
		assert.deepEqual(inPanel({ scale: 0.1, left: 0, top: 0 }, panel, image, high), fit(image, high));
	});
});

describe('fill', () => {
	it('covers the panel, around what matters', () => {
		const view = fill(image, { width: 400, height: 400 }, { x: 300, y: 600 });
		close([view.scale, view.top], [400 / 720, 0]);
		close([toScreen(view, { x: 300, y: 0 }).x], [Math.min(200, (300.5 * 400) / 720)]);
	});

	it('shows no bar, though what matters is at the border of the image', () => {
		for (const x of [0, 1279]) {
			const { scale, left } = fill(image, { width: 400, height: 400 }, { x, y: 0 });
			assert.ok(left <= 0 && left + 1280 * scale >= 400 - 1e-9);
		}
	});

	it('moves along what it hides and no farther', () => {
		const square = { width: 400, height: 400 };
		const view = fill(image, square, null);
		const far = pan(view, 9e4, 9e4, image, square);
		close([far.left, far.top], [0, 0]);
	});
});

describe('centeredOn', () => {
	it('puts the point into the middle of the panel', () => {
		const { x, y } = toScreen(centeredOn({ x: 900, y: 100 }, panel, 6), { x: 900, y: 100 });
		close([x, y], [320, 200]);
	});
});
