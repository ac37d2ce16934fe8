import assert from 'node:assert/strict';
import { describe, it } from 'node:test';
import { setTimeout as pause } from 'node:timers/promises';

import { latest } from '../../static/lib/latest.js';

describe('latest', () => {
	it('runs the first value at once and of the rest only the last', async () => {
		const seen = [];
		const work = latest(30, async (value) => { seen.push(value); });
		for (const value of [1, 2, 3]) work.run(value);
		await pause(10);
		work.run(4);
		work.run(5);
		await pause(60);
		assert.deepEqual(seen, [3, 5]);
	});

	it('never runs twice at once', async () => {
		let running = 0;
		let most = 0;
		const work = latest(1, async () => {
			running += 1;
			most = Math.max(most, running);
			await pause(15);
			running -= 1;
		});
		for (let i = 0; i < 6; i++) {
			work.run(i);
			await pause(4);
		}
		await pause(60);
		assert.equal(most, 1);
	});

	it('drops what waits when it is cancelled', async () => {
		const seen = [];
		const work = latest(20, async (value, signal) => { seen.push([value, signal.aborted]); });
		work.run('a');
		work.cancel();
		await pause(40);
		assert.deepEqual(seen, []);
	});
});
