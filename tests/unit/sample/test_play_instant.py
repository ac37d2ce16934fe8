from __future__ import annotations

import numpy as np
import pytest

from app.sample.play import (
    BALL_DIAMETER,
    PEOPLE,
    advance_instant,
    choose_shirt_numbers,
    clear_lines_of_sight,
    make_instant,
)


@pytest.fixture
def instant():
    rng = np.random.default_rng(1)
    return make_instant(rng, choose_shirt_numbers(rng))


class TestMakeInstant:
    def test_the_ball_is_never_below_the_grass_nor_above_eight_metres(self):
        rng = np.random.default_rng(2)
        heights = [-make_instant(rng, (0,) * PEOPLE).ball[2] for _ in range(300)]
        assert min(heights) >= BALL_DIAMETER / 2 - 1e-12
        assert max(heights) <= 8.0
        assert np.mean(np.array(heights) < 0.2) > 0.5

    def test_people_do_not_stand_in_each_other(self, instant):
        distance = np.linalg.norm(instant.feet[:, None] - instant.feet[None], axis=2)
        assert (distance + 9 * np.eye(PEOPLE)).min() > 0.5


class TestShirtNumbers:
    def test_a_team_wears_every_number_once(self):
        numbers = choose_shirt_numbers(np.random.default_rng(3))
        assert len(numbers) == PEOPLE
        assert numbers[0] == numbers[11] == 1
        assert numbers[22] == 0
        assert len(set(numbers[:11])) == len(set(numbers[11:22])) == 11


class TestLater:
    def test_the_ball_moves_by_the_shift_and_runners_run(self, instant):
        moved = advance_instant(instant, 0.5, np.array([2.0, 1.0, -1.0]))
        assert moved.ball == pytest.approx(instant.ball + np.array([2.0, 1.0, -1.0]))
        assert not np.allclose(moved.feet, instant.feet)

    def test_the_ball_does_not_sink_into_the_grass(self, instant):
        assert (
            advance_instant(instant, 0.5, np.array([0.0, 0.0, 50.0])).ball[2] == -BALL_DIAMETER / 2
        )


class TestClearSight:
    def test_nobody_stands_between_the_ball_and_a_camera(self, instant):
        camera = np.array([0.0, 60.0, -14.0])
        ball = np.array([30.0, 0.0, -BALL_DIAMETER / 2])
        toward = (camera[:2] - ball[:2]) / np.linalg.norm(camera[:2] - ball[:2])
        feet = instant.feet.copy()
        feet[5] = ball[:2] + 2.0 * toward
        blocked = type(instant)(**{**vars(instant), "ball": ball, "feet": feet})
        cleared = clear_lines_of_sight(blocked, camera[None])
        offset = cleared.feet[5] - ball[:2]
        assert abs(offset[0] * toward[1] - offset[1] * toward[0]) > 0.7
