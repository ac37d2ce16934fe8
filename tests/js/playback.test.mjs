/** A recording runs at its rate, however often it is stopped and played. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { makePlayer } from '../../static/state/playback.js';

globalThis.Image = /** @type {any} */ (class {
	async decode() {}
});

const FRAME = 40;
const turn = () => new Promise((resolve) => { setImmediate(resolve); });

/** How many frames pass in ten times that of one. @param {import('node:test').TestContext} t @param {(player: import('../../static/state/playback.js').Player) => void} begin */
async function passed(t, begin) {
	t.mock.timers.enable({ apis: ['setTimeout'] });
	const player = makePlayer();
	player.openFilm({ id: 1, sha256: null, frames: 1000, fps: 1000 / FRAME });
	begin(player);
	await turn();
	const before = player.wanted.value;
	for (let i = 0; i < 10; i += 1) {
		t.mock.timers.tick(FRAME);
		await turn();
	}
	player.stand();
	return player.wanted.value - before;
}

test('a recording that is stopped and played within a frame runs as fast as before', async (t) => {
	assert.equal(await passed(t, (player) => { player.run(1); player.stand(); player.run(1); }), 10);
});

test('so does one that is stepped and played', async (t) => {
	assert.equal(await passed(t, (player) => { player.run(1); player.stepBy(1); player.run(1); }), 10);
});

test('so does one that is played once another was opened', async (t) => {
	assert.equal(await passed(t, (player) => {
		player.run(1);
		player.openFilm({ id: 2, sha256: null, frames: 1000, fps: 1000 / FRAME });
		player.run(1);
	}), 10);
});
