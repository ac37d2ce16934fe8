"""Where a ball can be: the ends of the pitch, of the sky, and both together."""

from __future__ import annotations

import pytest

from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.plausible import implausible_reasons, is_plausible_position

PITCH = Pitch(105.0, 68.0)


class TestImplausible:
    @pytest.mark.parametrize(
        ("outside", "height"),
        [(10.0, 0.1), (8.0, 7.9), (5.0, 19.9), (0.0, 40.0), (-3.0, 39.0), (9.9, 0.0), (10.0, 2.0)],
    )
    def test_beside_the_pitch_a_ball_may_be_low_and_over_it_high(self, outside, height) -> None:
        assert is_plausible_position((0.0, 34.0 + outside, -height), PITCH, PAPER)

    @pytest.mark.parametrize(
        ("outside", "height", "reach"), [(8.0, 14.0, 6.5), (5.0, 20.5, 4.875), (1.0, 38.0, 0.5)]
    )
    def test_the_higher_a_ball_the_less_far_outside_it_may_be(self, outside, height, reach) -> None:
        ((number, limit, words),) = implausible_reasons(
            (52.5 + outside, 0.0, -height), PITCH, PAPER
        )
        assert (number, limit) == (pytest.approx(outside), pytest.approx(reach))
        assert words == f"is {outside:.0f} m outside the pitch at a height of {height:.2f} m"

    def test_each_end_alone_has_its_own_words(self) -> None:
        found = implausible_reasons((0.0, 62.0, 10.2), PITCH, PAPER)
        assert [words for _, _, words in found] == [
            "lies 10.20 m below the grass",
            "is 28 m outside the pitch",
        ]
        ((number, limit, words),) = implausible_reasons((0.0, 0.0, -41.0), PITCH, PAPER)
        assert (number, limit, words) == (41.0, 40.0, "flies 41.00 m above the grass")
