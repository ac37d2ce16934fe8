import assert from 'node:assert/strict';
import { beforeEach, describe, it } from 'node:test';

import { nextFrame } from '../../static/lib/drawing.js';

/** What waits for the next frame. @type {Map<number, () => void>} */
let waiting;
let handles = 0;

/** Let a frame pass. */
function frame() {
	const due = [...waiting.values()];
	waiting.clear();
	for (const work of due) work();
}

describe('nextFrame', () => {
	beforeEach(() => {
		waiting = new Map();
		globalThis.requestAnimationFrame = (work) => {
			handles += 1;
			waiting.set(handles, work);
			return handles;
		};
		globalThis.cancelAnimationFrame = (handle) => waiting.delete(handle);
	});

	it('works once for all that was asked for within a frame, and not before it', () => {
		let times = 0;
		const work = nextFrame(() => { times += 1; });
		for (let i = 0; i < 3; i++) work.ask();
		assert.equal(times, 0);
		frame();
		assert.equal(times, 1);
		frame();
		assert.equal(times, 1);
	});

	it('works again for what is asked for later, and while it works', () => {
		let times = 0;
		const work = nextFrame(() => {
			times += 1;
			if (times === 2) work.ask();
		});
		work.ask();
		frame();
		work.ask();
		frame();
		frame();
		assert.equal(times, 3);
	});

	it('forgets what was asked for, and can be asked again', () => {
		let times = 0;
		const work = nextFrame(() => { times += 1; });
		work.ask();
		work.cancel();
		frame();
		assert.equal(times, 0);
		work.ask();
		frame();
		assert.equal(times, 1);
	});
});
