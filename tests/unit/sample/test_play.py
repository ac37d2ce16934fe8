from __future__ import annotations

import numpy as np
import pytest

from app.sample.play import (
    BALL_STEP,
    GRAVITY,
    PEOPLE,
    PEOPLE_STEP,
    RADIUS,
    SPRINT,
    Play,
    make_play,
    step_ball,
)

NUMBERS = tuple(range(PEOPLE))


@pytest.fixture(scope="module")
def play() -> Play:
    return make_play(60.0, 3, NUMBERS)


class TestStepBall:
    def test_it_falls_bounces_lower_and_comes_to_rest(self) -> None:
        place, velocity = np.array([0.0, 0.0, 5.0]), np.array([3.0, 0.0, 0.0])
        heights, modes = [], []
        for _ in range(2000):
            modes.append(step_ball(place, velocity, BALL_STEP))
            heights.append(place[2])
        # Free fall of a second is half of g; the air takes little of it.
        assert heights[99] == pytest.approx(5.0 - GRAVITY / 2, abs=0.12)
        assert 0.8 < max(heights[150:]) < 2.0
        assert modes[0] == "flight"
        assert modes[-1] == "roll"
        assert np.hypot(*velocity[:2]) < 1e-9
        assert place[2] == RADIUS


class TestMakePlay:
    def test_the_same_seed_gives_the_same_and_longer_play_begins_alike(self, play: Play) -> None:
        longer = make_play(70.0, 3, NUMBERS)
        assert np.array_equal(longer.ball[: len(play.ball)], play.ball)
        assert not np.array_equal(make_play(60.0, 4, NUMBERS).ball, play.ball)

    def test_the_ball_is_held_rolls_and_flies_and_stays_on_the_pitch(self, play: Play) -> None:
        shares = {
            mode: play.modes.count(mode) / len(play.modes) for mode in ("held", "roll", "flight")
        }
        assert min(shares.values()) > 0.04
        assert (play.ball[:, 2] <= -RADIUS + 1e-9).all()
        assert (np.abs(play.ball[:, :2]) < (55.0, 36.0)).all()
        assert -play.ball[:, 2].min() > 3.0

    def test_it_moves_by_the_laws_while_it_flies(self, play: Play) -> None:
        falls = np.diff(play.ball[:, 2], 2) / BALL_STEP**2
        high = np.array([mode == "flight" for mode in play.modes[2:]]) & (play.ball[1:-1, 2] < -1.0)
        assert 9.0 < np.median(falls[high]) < 11.0
        # No jumps: what is fastest is a kick.
        assert np.linalg.norm(np.diff(play.ball, axis=0), axis=1).max() < 40 * BALL_STEP

    def test_people_run_as_people_do_and_reach_the_ball(self, play: Play) -> None:
        paces = np.linalg.norm(np.diff(play.feet, axis=0), axis=2) / PEOPLE_STEP
        assert np.percentile(paces, 99.9) < SPRINT + 1.0
        held = np.flatnonzero([mode == "held" for mode in play.modes[:5900:100]])
        near = [
            np.linalg.norm(
                play.instant_at(float(at)).feet - play.instant_at(float(at)).ball[:2], axis=1
            ).min()
            for at in held
        ]
        assert np.median(near) < 1.5

    def test_moments_between_steps_lie_between_them(self, play: Play) -> None:
        one, middle, other = (play.instant_at(seconds) for seconds in (10.0, 10.01, 10.02))
        assert np.allclose(middle.feet, (one.feet + other.feet) / 2)
        assert play.mode_at(10.0) == play.modes[1000]
        assert np.allclose(play.ball_at(np.array([10.0]))[0], one.ball)
