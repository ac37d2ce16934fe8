import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { arrangeScreen, GAP, gridArea, panelGrid, panelSize } from '../../static/geometry/panel_grid.js';
import { fit } from '../../static/geometry/viewport.js';

const WIDE = { width: 1920, height: 1080 };
/** Room of views and strip in windows of these sizes. */
const ROOMS = {
	'1440 x 900': { width: 1104, height: 844 }, '1100 x 700': { width: 764, height: 644 }, '1920 x 1080': { width: 1584, height: 1024 },
};

/** What is left to the views. */
function roomOf(room, { side, strip }) {
	return side === 'below'
		? { width: room.width, height: room.height - strip - GAP } : { width: room.width - strip - GAP, height: room.height };
}

/** Share of the views' room that shows picture. */
function filledShare(images, room, equal = false) {
	const grid = panelGrid(images, room, equal);
	const shown = images.reduce((sum, image, i) => {
		const { scale } = fit(image, panelSize(grid, grid.areas[i], room));
		return sum + scale * image.width * scale * image.height;
	}, 0);
	return shown / (room.width * room.height);
}

describe('arrangeScreen', () => {
	for (const [window, room] of Object.entries(ROOMS)) {
		for (const n of [1, 2, 3, 4, 6]) {
			it(`shows ${n} views of 16:9 on most of their room at ${window}`, () => {
				const images = Array.from({ length: n }, () => WIDE);
				const screen = arrangeScreen(images, room, { equal: false, beside: true, folded: false });
				assert.ok(filledShare(images, roomOf(room, screen)) > 0.74, `${filledShare(images, roomOf(room, screen))}`);
			});
		}

		it(`puts the strip beside two wide views, which are larger then, at ${window}`, () => {
			const images = [WIDE, WIDE];
			const how = { equal: false, beside: true, folded: false };
			const screen = arrangeScreen(images, room, how);
			assert.equal(screen.side, 'beside');
			assert.ok(screen.score > arrangeScreen(images, room, { ...how, beside: false }).score);
		});
	}

	it('keeps the strip below where the timeline needs the width', () => {
		const how = { equal: false, beside: false, folded: false };
		assert.equal(arrangeScreen([WIDE, WIDE], ROOMS['1440 x 900'], how).side, 'below');
	});

	it('gives the pictures more room when the strip is folded', () => {
		for (const n of [1, 2, 4]) {
			const images = Array.from({ length: n }, () => WIDE);
			const [open, folded] = [false, true].map((one) => (
				arrangeScreen(images, ROOMS['1100 x 700'], { equal: false, beside: true, folded: one }).score
			));
			assert.ok(folded > open, `${n} views`);
		}
	});
});

describe('panelGrid', () => {
	const room = { width: 1104, height: 560 };

	it('makes the main camera larger than any other, and nobody vanish', () => {
		for (const n of [3, 4, 5, 6]) {
			const images = Array.from({ length: n }, () => WIDE);
			const grid = panelGrid(images, room, false);
			const widths = grid.areas.map((area) => fit(WIDE, panelSize(grid, area, room)).scale * WIDE.width);
			assert.ok(widths.slice(1).every((width) => widths[0] > 1.2 * width && width > 200), `${n}: ${widths}`);
		}
	});

	it('makes all views equally large when that is wished', () => {
		const grid = panelGrid([WIDE, WIDE, WIDE, WIDE], room, true);
		const sizes = grid.areas.map((area) => JSON.stringify(panelSize(grid, area, room)));
		assert.equal(new Set(sizes).size, 1);
	});

	it('stacks tall pictures less than wide ones', () => {
		const tall = { width: 720, height: 1280 };
		assert.equal(panelGrid([tall, tall], room, false).columns.length, 2);
		assert.equal(panelGrid([WIDE, WIDE], { width: 600, height: 800 }, false).rows.length, 2);
	});

	it('gives every view a place of its own', () => {
		for (let n = 1; n <= 9; n++) {
			for (const equal of [false, true]) {
				const grid = panelGrid(Array.from({ length: n }, () => WIDE), room, equal);
				assert.equal(new Set(grid.areas.map((_, i) => gridArea(grid, i))).size, n);
			}
		}
	});
});
