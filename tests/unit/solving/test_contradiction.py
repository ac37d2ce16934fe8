"""Contradiction: named by leaving one out, explained by a ball that moved on."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from app.soccer.annotation import BallAnnotation
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration
from app.solving.ball_covariance import CovarianceOfMeanBall
from app.solving.contradiction import (
    LOW_P_VALUE,
    SPEEDS,
    TYPICAL_SPEED,
    Contradiction,
    compute_chi_square,
    find_contradiction,
)
from app.solving.facts import collect_facts
from app.solving.judgement import judge_groups
from app.solving.triangulate import collect_ball_observations, triangulate_observation_pairs
from tests.balls import seen
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view

GRASS = (36.0, 2.0, -0.113)
CAMERAS = {"a": MAIN, "b": BEHIND_GOAL, "c": OPPOSITE}
SHARP = tuple((1e-12 * np.eye(8)).ravel().tolist())
"""Of a camera that is known well, though not without end."""


def torn(
    keys: str,
    later: str = "",
    by=(0.0, 0.6, 0.0),
    ball=GRASS,
    covariance=SHARP,
    policy=PAPER,
    source="lines",
    left_open="",
):
    """Views of a ball, one of which shows it after it has moved on."""
    views = []
    for key in keys:
        place = np.add(ball, by) if key == later else ball
        point = BallAnnotation(point=seen(CAMERAS[key], place))
        views.append(replace(given_view(key, CAMERAS[key], ball), balls=(point,)))
    calibrations = [
        Calibration(source, CAMERAS[key], covariance=None if key in left_open else covariance)
        for key in keys
    ]
    sights = collect_ball_observations(views, calibrations)
    pairs = triangulate_observation_pairs(combinations(sights, 2))
    facts = collect_facts(views, calibrations, sights, pairs)
    judgement = judge_groups(facts, policy, CovarianceOfMeanBall(facts))
    chi_square = compute_chi_square(keys, facts, judgement, policy)
    return chi_square, find_contradiction(chi_square, keys, facts, judgement, sights, policy)


WIDE = replace(PAPER, tau_percent=5.0)


class TestChiSquareOf:
    def test_is_of_the_views_in_valid_pairs(self) -> None:
        chi_square, _ = torn("abc", "c", by=(0.0, 0.0, -3.0))
        assert chi_square is not None
        assert (chi_square.views, chi_square.freedom) == (("a", "b"), 1)

    def test_there_is_none_without_a_valid_pair(self) -> None:
        assert torn("ab", "b", by=(0.0, 0.0, -3.0)) == (None, None)


class TestContradiction:
    def test_views_of_one_instant_do_not_contradict_each_other(self) -> None:
        chi_square, found = torn("abc")
        assert chi_square is not None and chi_square.p_value > 0.99
        assert found is None

    @pytest.mark.parametrize("later", ["a", "b", "c"])
    def test_of_three_views_the_one_at_another_instant_is_named(self, later: str) -> None:
        chi_square, found = torn("abc", later, by=(0.4, 0.3, -0.4), policy=WIDE)
        assert chi_square is not None and chi_square.p_value < LOW_P_VALUE
        assert found is not None and found.view == later
        assert 0.9 <= found.confidence <= 1.0

    def test_how_far_the_ball_moved_is_measured_along_its_level(self) -> None:
        _, found = torn("abc", "a", by=(0.3, 0.4, 0.0), policy=WIDE)
        assert found is not None
        assert found.moved_m == pytest.approx(0.5, abs=0.02)
        assert found.gap_m is not None and found.gap_m <= 0.5

    def test_of_two_views_none_is_named_and_a_ball_on_the_grass_is_measured(self) -> None:
        _, found = torn("ab", "b", by=(0.3, 0.4, 0.0), policy=WIDE)
        assert found is not None and (found.view, found.confidence) == (None, None)
        assert found.moved_m == pytest.approx(0.5, abs=0.02)

    def test_of_a_ball_in_the_air_two_views_say_only_how_far_their_rays_miss(self) -> None:
        _, found = torn("ab", "b", by=(0.3, 0.4, 0.0), ball=(36.0, 2.0, -3.0), policy=WIDE)
        assert found is not None and found.moved_m is None
        assert found.gap_m is not None and 0.0 < found.gap_m <= 0.5

    def test_where_leaving_out_either_of_two_views_mends_it_none_is_named(self) -> None:
        """The ball moved in the plane of two rays: without the third they agree as well."""
        chi_square, found = torn("abc", "b", by=(0.3, 0.4, 0.0), policy=WIDE)
        assert chi_square is not None and chi_square.p_value < LOW_P_VALUE
        assert found is not None and (found.view, found.gap_m) == (None, None)

    def test_with_a_given_camera_it_is_said_that_nobody_knows_how_exact_it_is(self) -> None:
        given = {"covariance": None, "policy": WIDE, "source": "given"}
        chi_square, found = torn("abc", "c", by=(0.3, 0.4, 0.0), **given)
        assert chi_square is not None and chi_square.p_value < LOW_P_VALUE
        assert found is not None and not found.is_known
        assert found.widening == pytest.approx((chi_square.value / 3) ** 0.5)

    def test_a_camera_that_its_lines_leave_open_contradicts_nobody(self) -> None:
        by = {"by": (0.3, 0.4, 0.0), "policy": WIDE}
        chi_square, found = torn("abc", "c", left_open="c", **by)
        assert chi_square is not None and (chi_square.views, found) == (("a", "b"), None)
        for left_open in ("ac", "abc"):
            assert torn("abc", "c", left_open=left_open, **by) == (None, None)

    def test_a_camera_that_its_lines_leave_open_hides_no_contradiction_of_the_others(self) -> None:
        by = {"by": (0.3, 0.4, 0.0), "policy": WIDE}
        alone, _ = torn("ab", "b", **by)
        chi_square, found = torn("abc", "b", left_open="c", **by)
        assert chi_square is not None and alone is not None
        assert chi_square.p_value == pytest.approx(alone.p_value, rel=1e-3)
        assert found is not None and found.is_known

    def test_what_no_ball_moves_in_a_second_is_no_motion(self) -> None:
        chi_square, _ = torn("ab")
        assert chi_square is not None
        for moved_m, is_motion in ((TYPICAL_SPEED, True), (SPEEDS[1] + 1, False), (None, True)):
            found = Contradiction(chi_square, None, None, 0.3, moved_m)
            assert found.may_be_motion == is_motion
        assert not Contradiction(chi_square, None, None).may_be_motion
