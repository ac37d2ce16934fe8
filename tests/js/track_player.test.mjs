/** Playing a track. */

import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { makeTrackPlayer } from '../../static/state/track_player.js';

/** A player, and a clock that somebody else moves. */
function played({ calm = false, last = 200 } = {}) {
	let next = null;
	const player = makeTrackPlayer({ first: 100, last, rate: 25 }, { ask: (run) => { next = run; }, calm: () => calm });
	const tick = (now) => {
		const run = next;
		next = null;
		run?.(now);
	};
	return { player, tick };
}

describe('a track that is played', () => {
	it('runs at its own rate, and twice as fast when it is asked again', () => {
		const { player, tick } = played();
		player.run(1);
		tick(1000);
		tick(1400);
		assert.equal(player.at.value, 110);
		player.run(1);
		tick(1400);
		tick(1800);
		assert.deepEqual([player.at.value, player.speed.value], [130, 2]);
		player.run(-1);
		tick(1800);
		tick(2000);
		assert.deepEqual([player.at.value, player.speed.value], [125, -1]);
	});

	it('stands at its end, and begins anew from there', () => {
		const { player, tick } = played({ last: 110 });
		player.toggle();
		tick(0);
		tick(9000);
		assert.deepEqual([player.at.value, player.speed.value], [110, 0]);
		player.toggle();
		assert.deepEqual([player.at.value, player.speed.value], [100, 1]);
	});

	it('stands when somebody steps, and what was asked for before says nothing any more', () => {
		const { player, tick } = played();
		player.run(1);
		tick(0);
		player.stepBy(7);
		tick(4000);
		assert.deepEqual([player.at.value, player.speed.value], [107, 0]);
		player.stepBy(-999);
		assert.equal(player.at.value, 100);
	});

	it('goes as slowly as somebody chose', () => {
		const { player, tick } = played();
		player.changePace(-1);
		player.changePace(-1);
		assert.equal(player.pace.value, 0.25);
		player.run(1);
		tick(0);
		tick(800);
		assert.equal(player.at.value, 105);
	});

	it('shows two pictures a second where little shall move', () => {
		const { player, tick } = played({ calm: true });
		player.run(1);
		const seen = [];
		for (let now = 0; now <= 1100; now += 100) {
			tick(now);
			seen.push(player.at.value);
		}
		assert.deepEqual([...new Set(seen)], [100, 112, 125]);
	});
});
