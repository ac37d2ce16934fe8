"""Replays planted into a minute of a real ball: found at the right times, and as well as they say."""

from __future__ import annotations

import numpy as np
import pytest

from tests.bench.link import DATA, Outcome, hawkeye, outcome_of, plant

BALL = hawkeye()
pytestmark = pytest.mark.skipif(BALL is None, reason=f"no real ball in {DATA}")


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    return [outcome_of(plant(BALL, seed)) for seed in range(60)]


class TestHawkEyeMinute:
    def test_nearly_all_are_linked(self, outcomes) -> None:
        assert sum(one.found.reason is None for one in outcomes) >= 54

    def test_times_and_speeds_are_right(self, outcomes) -> None:
        linked = [one for one in outcomes if one.found.reason is None]
        frames, percent = (
            np.abs([getattr(one, of) for one in linked]) for of in ("frames", "percent")
        )
        assert np.median(frames) < 0.03
        assert (frames < 0.1).mean() >= 0.8
        assert (percent < 1.0).mean() >= 0.93

    def test_the_truth_is_inside_what_is_said(self, outcomes) -> None:
        z = np.array([one.z for one in outcomes if one.found.reason is None])
        assert 0.9 <= (np.abs(z) < 1.96).mean() <= 0.99

    def test_a_ball_at_rest_is_refused(self) -> None:
        rest = BALL.copy()
        rest[:, 1:] = (12.0, -8.0, -0.11)
        assert all(
            "hardly moves" in outcome_of(plant(rest, seed)).found.reason for seed in range(5)
        )
